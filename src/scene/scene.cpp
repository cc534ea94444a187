/// From a scene file and overrides to a checked Scene.
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>
#include <fstream>

namespace squeal
{

namespace
{

toml::table parse_file(const std::filesystem::path& file)
{
  if (!is_file(file)) throw Error("there is no scene file " + shortened(file));
  std::ifstream stream(file);
  int number = 0;
  for (std::string line; std::getline(stream, line);)
    refuse_deep_key(line, file.string() + ", line " + std::to_string(++number));
  try
  {
    return toml::parse_file(file.string());
  }
  catch (const toml::parse_error& error)
  {
    const auto& begin = error.source().begin;
    throw Error(file.string() + ", line " + std::to_string(begin.line) + ", column " + std::to_string(begin.column) +
                ": " + text_of(error));
  }
}

} // namespace

std::vector<double> frequencies_of(const ResponseSettings& response)
{
  std::vector<double> frequencies;
  for (int i = 0; i < response.count; ++i)
    frequencies.push_back(response.from + i * (response.to - response.from) / (response.count - 1));
  return frequencies;
}

double factor_at(const TimeFactor& factor, double time)
{
  const auto& [times, values] = factor;
  if (times.empty()) return 1;
  const auto next = std::upper_bound(times.begin(), times.end(), time);
  if (next == times.begin()) return values.front();
  if (next == times.end()) return values.back();
  const auto i = static_cast<std::size_t>(next - times.begin());
  const double part = (time - times[i - 1]) / (times[i] - times[i - 1]);
  return (1 - part) * values[i - 1] + part * values[i];
}

bool are_given(const Ramps& ramps)
{
  return !ramps.load.time.empty() || !ramps.speed.time.empty() || !ramps.friction.time.empty();
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

Scene read_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides)
{
  toml::table root = parse_file(file);
  for (const std::string& text : overrides) apply_override(root, text);
  Scene scene;
  scene.file = std::filesystem::absolute(file).lexically_normal();
  Places places{file.string(), {}};
  read_tables(root, scene, places);
  check_scene(scene, places);
  resolve_friction(scene);
  fit_damping(scene, places);
  resolve_branch(scene, places);
  resolve_sweep(scene, places);
  check_sensitivity(scene, places);
  resolve_robustness(scene, places);
  return scene;
}

} // namespace squeal
