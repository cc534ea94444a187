#include "robustness_results.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace squeal
{

namespace
{

using Json = nlohmann::ordered_json;

Json probability_entry(const Probability& probability)
{
  return {{"unstable_samples", probability.count},
          {"probability", probability.estimate()},
          {"lower", probability.lower},
          {"upper", probability.upper}};
}

/// The value below which a part of an ascending list is.
double part_of(const std::vector<double>& ascending, double part)
{
  const double place = part * static_cast<double>(ascending.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, ascending.size() - 1);
  return ascending[below] + (place - static_cast<double>(below)) * (ascending[above] - ascending[below]);
}

Json mode_entry(const RobustMode& mode)
{
  Json entry = {{"mode", mode.number}};
  if (mode.number >= 0)
  {
    entry["median_frequency_hz"] = frequency_hz_of(mode.lambda);
    entry["median_growth_rate"] = mode.lambda.real();
  }
  entry.update(probability_entry(mode.unstable));
  for (const auto& [name, part] : {std::pair{"5", 0.05}, std::pair{"50", 0.5}, std::pair{"95", 0.95}})
  {
    entry[std::string("growth_rate_") + name] = part_of(mode.growth_rates, part);
    entry[std::string("frequency_hz_") + name] = part_of(mode.frequencies, part);
  }
  return entry;
}

Json check_entry(const RobustCheck& check)
{
  return {{"sample", check.sample},
          {"known", check.known},
          {"unstable_modes", check.unstable},
          {"unstable_modes_reduced", check.unstable_reduced},
          {"growth_error", check.growth_error},
          {"frequency_error", check.frequency_error}};
}

/// Checks whose number of unstable modes the reduced model misses.
long wrong_verdicts(const Robustness& robustness)
{
  return std::ranges::count_if(robustness.checks, [](const RobustCheck& check)
                               { return check.known && check.unstable != check.unstable_reduced; });
}

std::string probability_text(const Probability& probability, double confidence)
{
  return format("%.4g (%.4g to %.4g at %g %%), %d of %d samples", probability.estimate(), probability.lower,
                probability.upper, 100 * confidence, probability.count, probability.samples);
}

} // namespace

void add_robustness(const Robustness& robustness, const Scene& scene, Json& entry)
{
  entry["samples"] = robustness.samples.size();
  entry["confidence"] = scene.robustness->confidence;
  entry["basis_shapes"] = robustness.basis;
  entry["growth_error"] = robustness.outcome.residual;
  entry["wrong_verdicts"] = wrong_verdicts(robustness);
  entry["any"] = probability_entry(robustness.any);
  entry["modes"] = Json::array();
  for (const RobustMode& mode : robustness.modes) entry["modes"].push_back(mode_entry(mode));
  entry["numbers"] = Json::array();
  for (std::size_t i = 0; i < robustness.correlation.size(); ++i)
    entry["numbers"].push_back({{"key", scene.uncertain[i].key},
                                {"name", name_of_number(scene, scene.uncertain[i].key)},
                                {"distribution", word(scene.uncertain[i].distribution)},
                                {"rank_correlation", robustness.correlation[i]}});
  entry["checks"] = Json::array();
  for (const RobustCheck& check : robustness.checks) entry["checks"].push_back(check_entry(check));
}

void write_robustness(Hdf5File& file, const Robustness& robustness)
{
  const std::size_t samples = robustness.samples.size();
  if (samples == 0) return;
  std::vector<double> values, growth, frequency;
  std::vector<int> known, unstable, closed, mode;
  for (const RobustSample& sample : robustness.samples)
  {
    values.insert(values.end(), sample.values.begin(), sample.values.end());
    growth.push_back(sample.growth_rate);
    frequency.push_back(sample.frequency_hz);
    known.push_back(sample.known ? 1 : 0);
    unstable.push_back(sample.unstable);
    closed.push_back(sample.closed);
    mode.push_back(sample.mode);
  }
  file.write("robustness/value", {samples, values.size() / samples}, values, "units of the keys");
  file.write("robustness/known", {samples}, known, "1: there is an equilibrium");
  file.write("robustness/unstable_modes", {samples}, unstable, "-");
  file.write("robustness/closed", {samples}, closed, "pairs");
  file.write("robustness/growth_rate", {samples}, growth, "1/s");
  file.write("robustness/frequency", {samples}, frequency, "Hz");
  file.write("robustness/mode", {samples}, mode, "-");
}

std::string robustness_csv(const Robustness& robustness, const Scene& scene)
{
  std::string text;
  for (const UncertainNumber& number : scene.uncertain) text += csv_text(number.key) + ",";
  text += "known,closed_pairs,unstable_modes,growth_rate,frequency_hz,mode\n";
  for (const RobustSample& sample : robustness.samples)
  {
    for (const double value : sample.values) text += format("%.17g,", value);
    text += format("%d,%d,%d,%.17g,%.17g,%d\n", sample.known ? 1 : 0, sample.closed, sample.unstable,
                   sample.growth_rate, sample.frequency_hz, sample.mode);
  }
  return text;
}

std::vector<std::string> robustness_lines(const Robustness& robustness, const Scene& scene)
{
  if (robustness.samples.empty()) return {};
  const double confidence = scene.robustness->confidence;
  std::vector<std::string> lines = {
      format("%zu samples of %zu random numbers on %d shapes; %zu computed in full: growth off by %.1e |lambda|, "
             "%ld wrong verdicts",
             robustness.samples.size(), scene.uncertain.size(), robustness.basis, robustness.checks.size(),
             robustness.outcome.residual, wrong_verdicts(robustness)),
      "probability of squeal " + probability_text(robustness.any, confidence)};
  for (const RobustMode& mode : robustness.modes)
    lines.push_back(
        (mode.number < 0 ? std::string("other modes: ") : format("mode at %.6g Hz: ", frequency_hz_of(mode.lambda))) +
        probability_text(mode.unstable, confidence) +
        format(", growth %.4g 1/s in the middle", part_of(mode.growth_rates, 0.5)));
  for (std::size_t i = 0; i < robustness.correlation.size(); ++i)
    lines.push_back(format("rank correlation of growth with %s: %+.2f",
                           label_of_number(scene, scene.uncertain[i].key).c_str(), robustness.correlation[i]));
  return lines;
}

} // namespace squeal
