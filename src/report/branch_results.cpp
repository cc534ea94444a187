#include "branch_results.hpp"

#include "derived.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace squeal
{

namespace
{

using Json = nlohmann::ordered_json;

Json point_entry(const BranchPoint& point, const Scene& scene)
{
  Json entry = {{"parameter", point.parameter},
                {"period", point.period},
                {"frequency_hz", 1 / point.period},
                {"residual", point.residual},
                {"mean_energy", point.measures.mean_energy},
                {"mean_fluctuating_energy", point.measures.mean_fluctuating_energy},
                {"open_pairs_mean", point.measures.open_pairs_mean},
                {"open_steps", point.measures.open_steps},
                {"lift_offs", point.measures.lift_offs},
                {"stick_steps", point.measures.stick_steps},
                {"stability", word(point.multipliers.stability)},
                {"multipliers", multiplier_list(point.multipliers)}};
  if (!std::isnan(point.full_residual)) entry["full_residual"] = point.full_residual;
  Json swings = Json::object();
  for (std::size_t i = 0; i < point.measures.peak_to_peak.size(); ++i)
    swings[scene.probes[i].name] = point.measures.peak_to_peak[i];
  entry["peak_to_peak"] = swings;
  return entry;
}

Json reduction_entry(const BranchReduction& reduction, const std::vector<BranchPoint>& points)
{
  Json entry = {{"shapes", reduction.shapes},
                {"active_pairs", reduction.active_pairs},
                {"missed_pairs", reduction.missed_pairs},
                {"interpolation_error", reduction.interpolation_error},
                {"corrections", Json::array()}};
  for (const CorrectedPoint& corrected : reduction.corrections)
  {
    Json point = {{"parameter", points[corrected.place].parameter}, {"converged", corrected.orbit.has_value()}};
    if (corrected.orbit)
    {
      point["frequency_hz"] = 1 / corrected.orbit->period;
      point["mean_fluctuating_energy"] = corrected.orbit->measures.mean_fluctuating_energy;
      point["residual"] = corrected.orbit->residual;
    }
    entry["corrections"].push_back(point);
  }
  return entry;
}

/// What the branch on a reduced model is worth.
std::vector<std::string> reduction_lines(const BrakeBranch& branch)
{
  if (!branch.reduction) return {};
  const BranchReduction& reduction = *branch.reduction;
  double largest = 0;
  for (const BranchPoint& point : branch.branch.points) largest = std::max(largest, point.full_residual);
  std::vector<std::string> lines = {format(
      "reduced model of %d shapes, %d pairs keep their contact; its cycles miss the full model's by at most %.1e "
      "a period; between samples its matrices are right to %.1e",
      reduction.shapes, reduction.active_pairs, largest, reduction.interpolation_error)};
  if (reduction.missed_pairs > 0)
    lines.push_back(format("%d more pairs of the full model open or stick", reduction.missed_pairs));
  for (const CorrectedPoint& corrected : reduction.corrections)
  {
    const BranchPoint& point = branch.branch.points[corrected.place];
    lines.push_back(
        corrected.orbit
            ? format("full model at %.6g: %.7g Hz, %.5g J, residual %.1e", point.parameter, 1 / corrected.orbit->period,
                     corrected.orbit->measures.mean_fluctuating_energy, corrected.orbit->residual)
            : format("full model at %.6g: no cycle was found next to the reduced model's", point.parameter));
  }
  return lines;
}

/// Of the largest multiplier; NaN where none is known.
double largest(const BranchPoint& point)
{
  const auto& values = point.multipliers.values;
  return values.empty() ? std::nan("") : std::abs(values.front());
}

std::string event_line(const BranchEvent& event)
{
  return format("%s at %.6g +- %.1e, %.6g Hz", word(event.kind), event.parameter, event.error, 1 / event.period) +
         (event.change == 0 ? "" : format(" (%+d)", event.change));
}

/// Places of at most `shown` of `count` entries, spread evenly.
std::vector<std::size_t> spread(std::size_t count, std::size_t shown)
{
  std::vector<std::size_t> places;
  const std::size_t taken = std::min(count, shown);
  for (std::size_t i = 0; i < taken; ++i) places.push_back(taken < 2 ? 0 : i * (count - 1) / (taken - 1));
  return places;
}

} // namespace

Json multiplier_list(const Multipliers& multipliers)
{
  Json list = Json::array();
  for (std::size_t i = 0; i < multipliers.values.size(); ++i)
    list.push_back({{"real", multipliers.values[i].real()},
                    {"imaginary", multipliers.values[i].imag()},
                    {"error", multipliers.errors[i]}});
  return list;
}

void add_branch(const BrakeBranch& branch, const Scene& scene, Json& entry)
{
  const BranchSettings& settings = *scene.branch;
  entry["key"] = settings.key;
  entry["name"] = name_of_number(scene, settings.key);
  entry["from"] = settings.from;
  entry["to"] = settings.to;
  entry["periods_integrated"] = branch.branch.periods;
  entry["tangent_columns"] = branch.branch.columns;
  entry["ends"] = {{"backward", word(branch.branch.ends.backward)}, {"forward", word(branch.branch.ends.forward)}};
  entry["model"] = word(branch.reduction ? CycleModel::reduced : CycleModel::full);
  if (branch.reduction) entry["reduction"] = reduction_entry(*branch.reduction, branch.branch.points);
  if (!branch.not_reduced.empty()) entry["not_reduced"] = branch.not_reduced;
  entry["points"] = Json::array();
  for (const BranchPoint& point : branch.branch.points) entry["points"].push_back(point_entry(point, scene));
  entry["events"] = Json::array();
  for (const BranchEvent& event : branch.branch.events)
    entry["events"].push_back({{"kind", word(event.kind)},
                               {"parameter", event.parameter},
                               {"error", event.error},
                               {"frequency_hz", 1 / event.period},
                               {"mean_fluctuating_energy", event.mean_fluctuating_energy},
                               {"change", event.change}});
  entry["equilibria"] = Json::array();
  for (const EquilibriumStability& equilibrium : branch.equilibria)
    if (equilibrium.known)
      entry["equilibria"].push_back({{"parameter", equilibrium.parameter},
                                     {"unstable_modes", equilibrium.unstable_modes},
                                     {"growth_rate", equilibrium.growth_rate},
                                     {"frequency_hz", equilibrium.frequency_hz}});
  entry["coexistence"] = Json::array();
  for (const ParameterRange& range : branch.coexistence)
    entry["coexistence"].push_back({{"from", range.from}, {"to", range.to}});
}

void add_attractors(const Attractors& attractors, Json& entry)
{
  entry["periods"] = attractors.periods;
  entry["starts"] = attractors.starts;
  entry["motions"] = Json::array();
  for (const ReachedMotion& motion : attractors.motions)
    entry["motions"].push_back({{"kind", word(motion.kind)},
                                {"mean_fluctuating_energy", motion.energy.value},
                                {"energy_error", motion.energy.error},
                                {"frequency_hz", motion.frequency.value},
                                {"frequency_error", motion.frequency.error},
                                {"starts", motion.starts}});
}

std::vector<std::string> attractor_lines(const Attractors& attractors)
{
  std::vector<std::string> lines = {
      format("%zu starts, each over %ld periods of the mode", attractors.starts.size(), attractors.periods)};
  for (const ReachedMotion& motion : attractors.motions)
  {
    const std::string reached = format("%zu of them lead to %s: ", motion.starts.size(), word(motion.kind));
    lines.push_back(motion.kind == ReachedKind::rest
                        ? reached.substr(0, reached.size() - 2)
                        : reached + format("%.6g +- %.1e Hz, mean fluctuating energy %.5g +- %.1e J",
                                           motion.frequency.value, motion.frequency.error, motion.energy.value,
                                           motion.energy.error));
  }
  return lines;
}

void write_branch(Hdf5File& file, const BrakeBranch& branch, const Scene& scene)
{
  const auto write = [&](const std::string& name, const std::string& unit, const auto& list, auto value)
  {
    std::vector<std::decay_t<decltype(value(list.front()))>> data;
    for (const auto& member : list) data.push_back(value(member));
    file.write("branch/" + name, {data.size()}, data, unit);
  };
  const auto& points = branch.branch.points;
  using Cycle = const BranchPoint&;
  write("parameter", "unit of the key", points, [](Cycle p) { return p.parameter; });
  write("frequency", "Hz", points, [](Cycle p) { return 1 / p.period; });
  write("mean_energy", "J", points, [](Cycle p) { return p.measures.mean_energy; });
  write("mean_fluctuating_energy", "J", points, [](Cycle p) { return p.measures.mean_fluctuating_energy; });
  write("largest_multiplier", "-", points, [](Cycle p) { return largest(p); });
  write("stability", "1 stable, 2 unstable, 3 undecided", points,
        [](Cycle p) { return static_cast<int>(p.multipliers.stability); });
  write("open_steps", "steps of pairs", points, [](Cycle p) { return p.measures.open_steps; });
  write("stick_steps", "steps of pairs", points, [](Cycle p) { return p.measures.stick_steps; });
  for (std::size_t i = 0; i < scene.probes.size() && !points.empty(); ++i)
    write("probes/" + scene.probes[i].name, "m", points, [i](Cycle p) { return p.measures.peak_to_peak[i]; });
  std::vector<EquilibriumStability> known = branch.equilibria;
  std::erase_if(known, [](const EquilibriumStability& equilibrium) { return !equilibrium.known; });
  using Judged = const EquilibriumStability&;
  write("equilibrium/parameter", "unit of the key", known, [](Judged e) { return e.parameter; });
  write("equilibrium/growth_rate", "1/s", known, [](Judged e) { return e.growth_rate; });
  write("equilibrium/frequency", "Hz", known, [](Judged e) { return e.frequency_hz; });
}

std::vector<std::string> branch_lines(const BrakeBranch& branch, const Scene& scene)
{
  constexpr std::size_t points_shown = 12, grazings_shown = 4;
  const Branch& followed = branch.branch;
  if (followed.points.empty()) return {};
  std::vector<std::string> lines = {
      format("%zu cycles along %s from %.6g to %.6g; %ld periods and %ld columns of the tangent",
             followed.points.size(), number_text(scene, scene.branch->key).c_str(), followed.points.front().parameter,
             followed.points.back().parameter, followed.periods, followed.columns),
      format("%12s %14s %14s %18s", "parameter", "frequency", "energy", "largest multiplier"),
      format("%12s %14s %14s %18s", "", "[Hz]", "[J]", "[-]")};
  for (const std::size_t i : spread(followed.points.size(), points_shown))
  {
    const BranchPoint& point = followed.points[i];
    lines.push_back(format("%12.6g %14.7g %14.5g %18.6f  %s", point.parameter, 1 / point.period,
                           point.measures.mean_fluctuating_energy, largest(point), word(point.multipliers.stability)));
  }
  std::size_t grazings = 0;
  for (const BranchEvent& event : followed.events)
    if (event.kind != BranchEventKind::grazing || ++grazings <= grazings_shown) lines.push_back(event_line(event));
  if (grazings > grazings_shown)
    lines.push_back(format("%zu more grazings are in report.json", grazings - grazings_shown));
  for (std::string& line : reduction_lines(branch)) lines.push_back(std::move(line));
  if (!branch.not_reduced.empty()) lines.push_back("followed on the full model: " + branch.not_reduced);
  for (const ParameterRange& range : branch.coexistence)
    lines.push_back(
        format("from %.6g to %.6g a stable cycle stands beside a stable equilibrium", range.from, range.to));
  return lines;
}

} // namespace squeal
