/// Random numbers of a scene: their distributions, and checks of them.
#include "bound_numbers.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <set>

namespace squeal
{

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

/// What is wrong with the keys of a number's distribution; empty: nothing.
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
