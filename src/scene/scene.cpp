/// From a scene file and overrides to a checked Scene.
#include "bound_numbers.hpp"
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <charconv>
#include <cmath>
#include <set>

namespace squeal
{

namespace
{

toml::table parse_file(const std::filesystem::path& file)
{
  if (!is_file(file)) throw Error("there is no scene file " + shortened(file));
  try
  {
    return toml::parse_file(file.string());
  }
  catch (const toml::parse_error& error)
  {
    const auto& begin = error.source().begin;
    throw Error(file.string() + ", line " + std::to_string(begin.line) + ", column " + std::to_string(begin.column) +
                ": " + text_of(error) +
                (text_of(error).find("utf-8") == std::string::npos ? "" : ": save the file as UTF-8"));
  }
}

/// Reads a number that is not negative and moves `at` behind it; returns false if there is none.
bool read_number(const char*& at, const char* end, long& value)
{
  const auto [stop, error] = std::from_chars(at, end, value);
  if (error != std::errc() || value < 0) return false;
  at = stop;
  return true;
}

} // namespace

std::optional<RowNames> row_names(const std::string& text)
{
  RowNames names;
  names.nodes = text.starts_with("node:");
  if (!names.nodes && !text.starts_with("dof:")) return {};
  const char* at = text.data() + text.find(':') + 1;
  const char* const end = text.data() + text.size();
  while (true)
  {
    RowNames::Range range;
    if (!read_number(at, end, range.first)) return {};
    range.last = range.first;
    if (at != end && *at == '-' && !read_number(++at, end, range.last)) return {};
    if (range.last < range.first) return {};
    names.ranges.push_back(range);
    if (at == end) return names;
    if (*at++ != ',') return {};
  }
}

std::vector<double> frequencies_of(const ResponseSettings& response)
{
  std::vector<double> frequencies;
  for (int i = 0; i < response.count; ++i)
    frequencies.push_back(response.from + i * (response.to - response.from) / (response.count - 1));
  return frequencies;
}

namespace
{

/// The place's number among those given, as of the first one above it.
std::size_t next_of(const FactorTable& factor, double place)
{
  return static_cast<std::size_t>(std::ranges::upper_bound(factor.at, place) - factor.at.begin());
}

} // namespace

double slope_at(const FactorTable& factor, double place)
{
  const auto& [at, value] = factor;
  const std::size_t next = next_of(factor, place);
  return next == 0 || next == at.size() ? 0 : (value[next] - value[next - 1]) / (at[next] - at[next - 1]);
}

double factor_at(const FactorTable& factor, double place)
{
  const auto& [at, value] = factor;
  if (at.empty()) return 1;
  const std::size_t next = next_of(factor, place);
  if (next == 0) return value.front();
  if (next == at.size()) return value.back();
  const double part = (place - at[next - 1]) / (at[next] - at[next - 1]);
  return (1 - part) * value[next - 1] + part * value[next];
}

bool are_given(const Ramps& ramps)
{
  return !ramps.load.at.empty() || !ramps.speed.at.empty() || !ramps.friction.at.empty();
}

void take_drives(Scene& scene)
{
  for (Contact& contact : scene.contacts)
  {
    if (contact.driven_by < 0) continue;
    const Rotor& rotor = scene.rotors[static_cast<std::size_t>(contact.driven_by)];
    contact.velocity = rotor.velocity;
    if (rotor.rotation.axis != Vec3{}) contact.rotation = rotor.rotation;
  }
}

void drive_contacts(Scene& scene, std::span<const int> rotors)
{
  for (std::size_t i = 0; i < scene.contacts.size(); ++i)
  {
    Contact& contact = scene.contacts[i];
    if (rotors[i] < 0 || contact.driven_by == rotors[i]) continue;
    if (!is_undriven(contact))
      throw Error("[[contact]] of " + contact.stator + " on " + contact.rotor +
                  " has a drive of its own, and [[rotor]] " + scene.rotors[static_cast<std::size_t>(rotors[i])].part +
                  " drives it too: take rotation or velocity out of the contact");
    contact.driven_by = rotors[i];
  }
  for (std::size_t r = 0; r < scene.rotors.size(); ++r)
    if (std::ranges::find(rotors, static_cast<int>(r)) == rotors.end())
      throw Error("[[rotor]] " + scene.rotors[r].part +
                  " drives nothing: no [[contact]] has one of its surfaces for rotor");
  take_drives(scene);
  check_scene(scene, places_of(scene));
  resolve_friction(scene);
}

void resolve_friction(Scene& scene)
{
  const FrictionLaw& law = scene.friction;
  if (std::max(law.coefficient, law.static_coefficient) == 0) return;
  for (Contact& contact : scene.contacts)
    if (is_undriven(contact) && !contact.friction) contact.friction = law;
}

std::string Places::at(const void* member) const
{
  const auto found = given.find(member);
  return found == given.end() ? file : found->second;
}

void Places::refuse(const void* member, const std::string& text) const
{
  throw Error(at(member) + ": " + text);
}

Scene read_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides)
{
  toml::table root = parse_file(file);
  for (const std::string& text : overrides) apply_override(root, text);
  Scene scene;
  scene.file = std::filesystem::absolute(file).lexically_normal();
  Places places{file.string(), {}};
  read_tables(root, scene, places);
  check_scene(scene, places);
  if (scene.rotors.empty()) resolve_friction(scene); // else the mesh tells which contacts they drive
  resolve_branch(scene, places);
  resolve_sweep(scene, places);
  check_sensitivity(scene, places);
  resolve_robustness(scene, places);
  return scene;
}

bool has_preload(const Scene& scene)
{
  return !scene.bolts.empty() || scene.gravity != Vec3{} ||
         std::ranges::any_of(scene.supports, [](const Support& support) { return moves(support); });
}

// Random numbers of a scene: their distributions, and checks of them.

namespace
{

constexpr double cut_off = 4; // deviations: 6 of 100 000 draws are beyond

/// The quantile of the normal distribution of mean 0 and deviation 1, cut off.
double standard_quantile(double part)
{
  const boost::math::normal standard;
  const double least = boost::math::cdf(standard, -cut_off);
  return boost::math::quantile(standard, least + part * (1 - 2 * least));
}

/// The error in the keys of a number's distribution; empty: none.
std::string problem_of_form(const UncertainNumber& number)
{
  if (number.distribution == Distribution::uniform)
    return number.mean != 0 || number.deviation != 0 ? "is uniform: give from and to, not mean and deviation"
           : number.from < number.to                 ? ""
                                                     : "is uniform: give from, and a greater to";
  if (number.from != 0 || number.to != 0)
    return std::string("is ") + word(number.distribution) + ": give mean and deviation, not from and to";
  return number.deviation == 0 ? "needs a deviation, in the number's own unit" : "";
}

/// How far a number is taken, and what keeps it nearer, to go before what is wrong with that.
std::string reach_of(const UncertainNumber& number, double end)
{
  if (number.distribution == Distribution::uniform) return format("is taken to %g: ", end);
  return format(
      "is taken to %g, %g deviations from its middle; a smaller deviation, or distribution \"uniform\"%s, keeps "
      "it nearer: ",
      end, cut_off, number.distribution == Distribution::normal ? " or \"lognormal\"" : "");
}

} // namespace

double quantile(const UncertainNumber& number, double part)
{
  if (number.distribution == Distribution::uniform) return number.from + part * (number.to - number.from);
  const double normal = standard_quantile(part);
  if (number.distribution == Distribution::normal) return number.mean + number.deviation * normal;
  // mean and deviation are those of the number itself: of ln they follow from exp's moments
  const double variance = std::log1p(std::pow(number.deviation / number.mean, 2));
  return number.mean * std::exp(std::sqrt(variance) * normal - variance / 2);
}

void resolve_robustness(Scene& scene, const Places& places)
{
  if (!scene.robustness && !scene.uncertain.empty())
    places.refuse(&scene.uncertain.front(), "[[uncertain]] is part of [robustness]: give that table too");
  if (!scene.robustness) return;
  RobustnessSettings& settings = *scene.robustness;
  if (scene.uncertain.empty()) places.refuse(&settings, "[robustness] has no random number: give [[uncertain]] tables");
  if (settings.confidence <= 0 || settings.confidence >= 1)
    places.refuse(&settings.confidence, "[robustness] confidence must be between 0 and 1, such as 0.95");
  std::set<std::string> keys;
  for (UncertainNumber& number : scene.uncertain)
  {
    const std::string label = "[[uncertain]] " + number.key + " ";
    if (!keys.insert(number.key).second) places.refuse(&number, label + "is there twice: keep one");
    double own = 0;
    prefixed(places.at(&number) + ": ", [&] { own = number_at(scene, number.key, "[[uncertain]]"); });
    if (number.mean == 0 && number.distribution != Distribution::uniform) number.mean = own;
    if (const std::string problem = problem_of_form(number); !problem.empty()) places.refuse(&number, label + problem);
    if (number.distribution == Distribution::lognormal && number.mean <= 0)
      places.refuse(&number, label + "is lognormal: its mean must be positive");
    for (const double part : {0., 1.})
      need_scene(scene, {number.key, quantile(number, part)}, places.at(&number),
                 label + reach_of(number, quantile(number, part)));
  }
}

} // namespace squeal
