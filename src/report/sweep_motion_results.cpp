#include "sweep_motion_results.hpp"

#include "sweep_results.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace squeal
{

namespace
{

using Json = nlohmann::ordered_json;

/// A number of a motion as the files name it.
struct MotionNumber
{
  const char* name;
  const char* unit;
  double (*of)(const SweptMotion& motion);
};

constexpr std::array motion_numbers = {
    MotionNumber{"frequency_hz", "Hz", [](const SweptMotion& motion) { return motion.frequency_hz; }},
    MotionNumber{"mean_fluctuating_energy", "J", [](const SweptMotion& motion) { return motion.energy.value; }},
    MotionNumber{"energy_error", "J", [](const SweptMotion& motion) { return motion.energy.error; }},
    MotionNumber{"largest_multiplier", "-", [](const SweptMotion& motion) { return motion.multiplier; }},
    MotionNumber{"multiplier_error", "-", [](const SweptMotion& motion) { return motion.multiplier_error; }},
    MotionNumber{"estimated_amplitude", "m", [](const SweptMotion& motion) { return motion.estimate; }},
    MotionNumber{"residual", "-", [](const SweptMotion& motion) { return motion.residual; }},
};

double swing_of(const SweptMotion& motion, std::size_t probe)
{
  return probe < motion.peak_to_peak.size() ? motion.peak_to_peak[probe] : SweptMotion::none;
}

std::string csv_number(double number)
{
  return std::isnan(number) ? "," : format(",%.17g", number);
}

} // namespace

bool has_motions(const Sweep& sweep)
{
  return std::ranges::any_of(sweep.points, [](const SweepPoint& point) { return point.motion.has_value(); });
}

Json motion_entry(const SweptMotion& motion, const Scene& scene)
{
  Json entry = {{"outcome", word(motion.outcome.kind)}, {"heard", motion.heard}};
  if (!motion.outcome.reason.empty()) entry["reason"] = motion.outcome.reason;
  entry["kind"] = word(motion.kind);
  entry["stability"] = word(motion.stability);
  for (const MotionNumber& number : motion_numbers) entry[number.name] = number.of(motion);
  entry["peak_to_peak"] = Json::object();
  for (std::size_t i = 0; i < std::min(scene.probes.size(), motion.peak_to_peak.size()); ++i)
    entry["peak_to_peak"][scene.probes[i].name] = motion.peak_to_peak[i];
  entry["steps_per_period"] = motion.steps_per_period;
  entry["periods_integrated"] = motion.periods;
  return entry;
}

void write_motions(Hdf5File& file, const Sweep& sweep, const Scene& scene)
{
  if (!has_motions(sweep)) return;
  const auto column = [&](const auto& of)
  {
    std::vector<double> values;
    for (const SweepPoint& point : sweep.points) values.push_back(point.motion ? of(*point.motion) : SweptMotion::none);
    return values;
  };
  std::vector<int> kinds, verdicts;
  for (const SweepPoint& point : sweep.points)
  {
    kinds.push_back(point.motion ? static_cast<int>(point.motion->kind) : -1);
    verdicts.push_back(point.motion ? static_cast<int>(point.motion->stability) : -1);
  }
  const std::size_t size = sweep.points.size();
  file.write("sweep/motion/kind", {size}, kinds, "-1 none, 0 undecided, 1 periodic, 2 quasi-periodic, 3 irregular");
  file.write("sweep/motion/stability", {size}, verdicts, "-1 none, 0 not examined, 1 stable, 2 unstable, 3 undecided");
  for (const MotionNumber& number : motion_numbers)
    file.write(std::string("sweep/motion/") + number.name, {size}, column(number.of), number.unit);
  for (std::size_t i = 0; i < scene.probes.size(); ++i)
    file.write("sweep/motion/probes/" + scene.probes[i].name, {size},
               column([i](const SweptMotion& motion) { return swing_of(motion, i); }), "m");
}

std::string motions_csv(const Sweep& sweep, const Scene& scene)
{
  std::string text;
  for (const std::string& key : scene.sweep->key) text += csv_text(key) + ",";
  text += "direction,outcome,kind,stability";
  for (const MotionNumber& number : motion_numbers) text.append(",").append(number.name);
  text += ",steps_per_period,periods_integrated";
  for (const Probe& probe : scene.probes) text.append(",").append(csv_text(probe.name));
  text += ",heard\n";
  for (const SweepPoint& point : sweep.points)
  {
    if (!point.motion) continue;
    const SweptMotion& motion = *point.motion;
    for (const double value : point.values) text += format("%.17g,", value);
    text += format("%d,%s,%s,%s", point.reversed ? -1 : 1, word(motion.outcome.kind), word(motion.kind),
                   word(motion.stability));
    for (const MotionNumber& number : motion_numbers) text += csv_number(number.of(motion));
    text += format(",%d,%ld", motion.steps_per_period, motion.periods);
    for (std::size_t i = 0; i < scene.probes.size(); ++i) text += csv_number(swing_of(motion, i));
    text.append(",").append(csv_text(motion.heard)).append("\n");
  }
  return text;
}

std::vector<std::string> motion_lines(const Sweep& sweep)
{
  constexpr std::size_t shown = 24;
  std::vector<std::string> lines;
  std::size_t motions = 0;
  for (const SweepPoint& point : sweep.points)
    if (point.motion && ++motions <= shown)
      lines.push_back(text_of(point.values) + (point.reversed ? " reversed: " : ": ") + point.motion->heard);
  if (motions > shown) lines.push_back(format("%zu more are in sweep_motions.csv", motions - shown));
  return lines;
}

} // namespace squeal
