#include "squeal/report/json.hpp"

#include "branch_results.hpp"
#include "derived.hpp"
#include "files.hpp"
#include "response_results.hpp"
#include "robustness_results.hpp"
#include "sensitivity_results.hpp"
#include "squeal/report/heard.hpp"
#include "sweep_results.hpp"
#include "warnings.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace squeal
{

namespace
{

using Json = nlohmann::ordered_json;

/// The outcome of a stage, the start of its entry.
Json entry_of(const Outcome& outcome)
{
  Json entry = {{"outcome", word(outcome.kind)}};
  if (!outcome.reason.empty()) entry["reason"] = outcome.reason;
  return entry;
}

Json equilibrium_entry(const Report& report, const Scene& scene)
{
  const Equilibrium& equilibrium = report.point.equilibrium;
  Json entry = entry_of(equilibrium.outcome);
  if (!has_run(equilibrium.outcome)) return entry;
  const NormalForces normal = normal_forces(equilibrium);
  entry["iterations"] = equilibrium.outcome.iterations;
  entry["closed"] = normal.closed;
  entry["normal_force_sum"] = normal.sum;
  entry["normal_force_min"] = normal.least;
  entry["normal_force_max"] = normal.greatest;
  entry["residual"] = equilibrium.outcome.residual;
  entry["force_residual"] = equilibrium.force_residual;
  entry["auxiliary_stiffness"] = equilibrium.auxiliary_stiffness;
  entry["uniqueness"] = word(equilibrium.uniqueness);
  if (const auto& history = equilibrium.history)
    entry["undriven_pairs"] = {{"increments", history->increments},
                               {"change", history->change},
                               {"open", history->open},
                               {"stick", history->stick},
                               {"slip", history->slip},
                               {"at_limit", history->at_limit},
                               {"index", history->index},
                               {"reciprocal_condition", history->reciprocal_condition}};
  for (std::size_t i = 0; i < report.contacts.size(); ++i)
  {
    entry["contacts"].push_back({{"rotor", scene.contacts[i].rotor},
                                 {"stator", scene.contacts[i].stator},
                                 {"normal_force_sum", report.contacts[i].normal_force}});
    if (scene.contacts[i].rotation) entry["contacts"].back()["torque"] = report.contacts[i].torque;
  }
  for (std::size_t i = 0; i < report.equilibrium_probes.size(); ++i)
    entry["probes"][scene.probes[i].name] = report.equilibrium_probes[i];
  return entry;
}

Json mode_list(const std::vector<ComplexMode>& modes)
{
  Json list = Json::array();
  for (const ComplexMode& mode : modes)
    list.push_back({{"frequency_hz", mode.frequency_hz()},
                    {"growth_rate", mode.growth_rate()},
                    {"damping_ratio", mode.damping_ratio()},
                    {"backward_error", mode.backward_error},
                    {"unstable", is_unstable(mode.lambda)}});
  return list;
}

Json modes_entry(const Modes& modes)
{
  Json entry = entry_of(modes.outcome);
  if (!has_run(modes.outcome)) return entry;
  entry["method"] = word(modes.method);
  entry["iterations"] = modes.outcome.iterations;
  entry["residual"] = modes.outcome.residual;
  entry["band_hz"] = modes.band;
  entry["unstable_count"] = modes.unstable_count;
  entry["count_check"] = modes.count_check;
  entry["count_certified_by"] =
      modes.count.certified_by == Certificate::none ? Json(nullptr) : Json(word(modes.count.certified_by));
  entry["count_expected"] = modes.count.expected;
  entry["count_found"] = modes.count.found;
  entry["count_frequency_hz"] = modes.count.frequency;
  entry["beyond_band_hz"] = modes.beyond_band;
  entry["modes"] = mode_list(modes.modes);
  if (!modes.projected.empty()) entry["projected"] = mode_list(modes.projected);
  return entry;
}

Json estimate_entry(const Estimate& estimate)
{
  Json entry = entry_of(estimate.outcome);
  if (!has_run(estimate.outcome)) return entry;
  const bool balance = estimate.outcome.kind == OutcomeKind::balance;
  entry["amplitude"] = balance ? Json(estimate.amplitude) : Json(nullptr); // no balance is no amplitude of zero
  entry["mean_energy"] = balance ? Json(estimate.mean_energy) : Json(nullptr);
  entry["lift_off_amplitude"] = estimate.lift_off_amplitude;
  entry["reversal_amplitude"] = estimate.reversal_amplitude;
  entry["damping_rate"] = estimate.damping_rate;
  entry["friction_rate_linear"] = estimate.friction_rate_linear;
  entry["phase"] = estimate.phase;
  entry["residual"] = estimate.outcome.residual;
  entry["curve"] = {{"amplitude", estimate.curve_amplitude}, {"friction_rate", estimate.curve_rate}};
  return entry;
}

Json transient_entry(const Report& report)
{
  const Trajectory& transient = report.transient;
  Json entry = entry_of(transient.outcome);
  if (!has_run(transient.outcome)) return entry;
  entry["theta"] = transient.theta;
  entry["steps"] = transient.steps;
  entry["step_size"] = transient.step_size;
  entry["periods"] = transient.periods;
  entry["growth_rate_fit"] = transient.growth_rate_fit;
  entry["growth_rate_predicted"] = transient.predicted.real();
  entry["growth_rate_bias"] = transient_bias(report).growth;
  entry["frequency_bias"] = transient_bias(report).frequency;
  entry["normal_force_chatter"] = chatter(transient.history);
  entry["energy_defect_max"] = transient.energy_defect_max;
  if (!transient.history.joint_work.empty()) entry["joint_work"] = transient.history.joint_work;
  entry["residual"] = transient.outcome.residual;
  entry["contact_iterations_mean"] = transient.contact_iterations_mean;
  entry["contact_steps_as_one"] = transient.contact_steps_as_one;
  entry["seconds_per_step"] = transient.seconds_per_step;
  return entry;
}

Json newton_list(const std::vector<NewtonRecord>& records)
{
  Json list = Json::array();
  for (const NewtonRecord& record : records)
    list.push_back({{"stage", word(record.stage)},
                    {"unknowns", record.unknowns},
                    {"periods", record.periods},
                    {"period", record.period},
                    {"residual_projected", record.residual_projected},
                    {"residual_full", record.residual_full}});
  return list;
}

Json multiplier_entry(const Multipliers& multipliers)
{
  if (multipliers.values.empty()) // the run was asked to end before
    return {{"stability", word(multipliers.stability)}, {"would_decide", multipliers.would_decide}};
  Json entry = {{"stability", word(multipliers.stability)},        {"method", word(multipliers.method)},
                {"trivial_error", multipliers.trivial_error},      {"periods_integrated", multipliers.periods},
                {"upper_bound", largest_upper_bound(multipliers)}, {"values", multiplier_list(multipliers)}};
  if (multipliers.crossing != Crossing::none) entry["crossing"] = word(multipliers.crossing);
  if (!multipliers.refusal.empty()) entry["refusal"] = multipliers.refusal;
  for (const SeenGrowth& seen : multipliers.seen)
    entry["seen"].push_back(
        {{"part", seen.part}, {"periods", seen.periods}, {"growth", seen.growth}, {"error", seen.error}});
  if (!multipliers.would_decide.empty()) entry["would_decide"] = multipliers.would_decide;
  return entry;
}

Json cycle_entry(const Report& report, const Scene& scene)
{
  const LimitCycle& cycle = report.motion.cycle;
  Json entry = entry_of(cycle.outcome);
  if (!has_run(cycle.outcome) || cycle.outcome.kind == OutcomeKind::refused) return entry;
  entry["period"] = cycle.orbit.period;
  entry["frequency_hz"] = 1 / cycle.orbit.period;
  entry["mode"] = report.motion.followed.index;
  entry["steps_per_period"] = cycle.steps_per_period;
  entry["tolerance"] = cycle.tolerance;
  entry["residual_projected"] = cycle.convergence.residual_projected;
  entry["residual_full"] = cycle.orbit.residual;
  entry["growth_rate_bias"] = cycle_bias(report).growth;
  entry["frequency_bias"] = cycle_bias(report).frequency;
  entry["normal_force_chatter"] = chatter(cycle.measured.history);
  entry["newton_iterations"] = cycle.convergence.iterations;
  entry["periods_integrated"] = cycle.convergence.periods;
  entry["mean_energy"] = cycle.measured.mean_energy;
  entry["mean_fluctuating_energy"] = cycle.measured.mean_fluctuating_energy;
  entry["open_pairs_mean"] = cycle.measured.open_pairs_mean;
  entry["open_pairs_max"] = cycle.measured.open_pairs_max;
  entry["stick_pairs_max"] = cycle.measured.stick_pairs_max;
  Json swings = Json::object();
  const std::size_t probes = std::min(scene.probes.size(), cycle.measured.peak_to_peak.size());
  for (std::size_t i = 0; i < probes; ++i) swings[scene.probes[i].name] = cycle.measured.peak_to_peak[i];
  entry["peak_to_peak"] = swings;
  if (cycle.multipliers.stability != Stability::not_examined)
    entry["multipliers"] = multiplier_entry(cycle.multipliers);
  entry["newton"] = newton_list(cycle.convergence.records);
  return entry;
}

Json estimated(const MeanValue& value)
{
  return {{"mean", value.value}, {"error", value.error}};
}

Json base_entry(const BaseFrequencies& base)
{
  return {{"first", base.first},
          {"second", base.second},
          {"closes_after", base.closes_after},
          {"explained", base.explained}};
}

Json settled_entry(const Report& report, const Scene& scene)
{
  const SettledMotion& settled = report.motion.settled;
  const ExaminedMotion& motion = settled.examined;
  Json entry = entry_of(settled.outcome);
  if (!has_run(settled.outcome)) return entry;
  entry["kind"] = word(motion.verdict.kind);
  entry["between"] = motion.verdict.between;
  entry["would_decide"] = motion.verdict.would_decide;
  entry["periods"] = motion.periods();
  entry["discarded"] = motion.discarded;
  entry["period"] = settled.period;
  entry["steps_per_period"] = settled.steps_per_period;
  entry["mean_energy"] = estimated(settled.energy);
  entry["mean_fluctuating_energy"] = estimated(settled.fluctuating_energy);
  entry["step_error"] = settled.step_error;
  entry["least_energy"] = settled.least_energy;
  entry["greatest_energy"] = settled.greatest_energy;
  entry["shapes"] = settled.shapes.coordinates.size();
  entry["energy_beside_shapes"] = settled.shapes.left_out;
  entry["damping_power"] = estimated(settled.damping_power);
  entry["contact_power"] = estimated(settled.contact_power);
  entry["load_power"] = estimated(settled.load_power);
  entry["open_fraction"] = estimated(settled.open_fraction);
  entry["stick_fraction"] = estimated(settled.stick_fraction);
  entry["slip_fraction"] = estimated(settled.slip_fraction);
  entry["peak_to_peak"] = Json::object();
  const std::size_t probes = std::min(scene.probes.size(), settled.peak_to_peak.size());
  for (std::size_t i = 0; i < probes; ++i)
    entry["peak_to_peak"][scene.probes[i].name] = estimated(settled.peak_to_peak[i]);
  entry["exponents"] = Json::array();
  for (const MeanValue& one : motion.exponents) entry["exponents"].push_back(estimated(one));
  entry["base_frequencies_hz"] = base_entry(motion.base);
  const bool of_probe = settled.spectrum_probe >= 0;
  entry["spectrum_of"] =
      of_probe ? scene.probes[static_cast<std::size_t>(settled.spectrum_probe)].name : std::string("normal force");
  entry["lines"] = Json::array();
  constexpr std::size_t most = 20;
  for (std::size_t i = 0; i < std::min(most, motion.spectrum.lines.size()); ++i)
    entry["lines"].push_back(
        {{"frequency_hz", motion.spectrum.lines[i].frequency_hz}, {"amplitude", motion.spectrum.lines[i].amplitude}});
  return entry;
}

Json attempt_entry(const Attempt& attempt)
{
  Json entry = entry_of(attempt.outcome);
  entry["name"] = attempt.name;
  entry["steps_per_period"] = attempt.steps_per_period;
  return entry;
}

Json fidelity_entry(const Fidelity& fidelity)
{
  Json entry = {{"asked", word(fidelity.asked)}, {"used", word(fidelity.used)}};
  if (!fidelity.reason.empty()) entry["reason"] = fidelity.reason;
  if (fidelity.asked == CycleModel::full) return entry;
  entry["accuracy"] = fidelity.accuracy;
  entry["size"] = fidelity.size;
  entry["modes"] = fidelity.modes;
  entry["attachment_shapes"] = fidelity.attachment_shapes;
  entry["left_out_shapes"] = fidelity.left_out_shapes;
  entry["lost_compliance"] = fidelity.lost_compliance;
  entry["active_pairs"] = fidelity.active_pairs;
  entry["sliding_pairs"] = fidelity.sliding_pairs;
  entry["steps_per_period"] = fidelity.steps_per_period;
  entry["verdict_steps"] = fidelity.verdict_steps;
  entry["contact_tolerance"] = fidelity.contact_tolerance;
  entry["reduced_periods"] = fidelity.reduced_periods;
  entry["full_periods"] = fidelity.full_periods;
  entry["error_estimates"] = {{"frequency", fidelity.frequency_error},
                              {"energy", fidelity.energy_error},
                              {"step_frequency", fidelity.step_frequency_error},
                              {"step_energy", fidelity.step_energy_error}};
  entry["seconds"] = {{"reduction", fidelity.reduction_seconds},
                      {"reduced_cycles", fidelity.reduced_seconds},
                      {"full_periods", fidelity.full_seconds}};
  return entry;
}

Json coarse_entry(const CoarseStart& coarse)
{
  Json entry = entry_of(coarse.outcome);
  if (!has_run(coarse.outcome)) return entry;
  entry["dofs"] = coarse.dofs;
  entry["pairs"] = coarse.pairs;
  entry["residual"] = coarse.outcome.residual;
  entry["frequency_hz"] = 1 / coarse.period; // null where there is no cycle
  entry["mean_fluctuating_energy"] = coarse.mean_fluctuating_energy;
  entry["periods"] = coarse.periods;
  return entry;
}

/// The outcome of a study and, where it ran, what it found.
template <class Study>
Json study_entry(const Study& study, const Scene& scene, void (*add)(const Study&, const Scene&, Json&))
{
  Json entry = entry_of(study.outcome);
  if (has_run(study.outcome)) add(study, scene, entry);
  return entry;
}

/// What of each contact's slave surface faces the other one.
void add_coverage(const std::vector<Coverage>& coverage, const Scene& scene, Json& model)
{
  for (std::size_t i = 0; i < coverage.size(); ++i)
    model["contacts"].push_back({{"rotor", scene.contacts[i].rotor},
                                 {"stator", scene.contacts[i].stator},
                                 {"slave_area", coverage[i].area},
                                 {"covered_area", coverage[i].covered},
                                 {"closed_mismatch", coverage[i].closed},
                                 {"offset", coverage[i].offset}});
}

Json attractors_entry(const Report& report)
{
  Json entry = entry_of(report.attractors.outcome);
  if (has_run(report.attractors.outcome)) add_attractors(report.attractors, entry);
  return entry;
}

} // namespace

std::string report_json(const Report& report, const Scene& scene)
{
  Json json;
  json["format_version"] = format_version;
  json["run"] = report.run;
  json["exit_code"] = report.exit_code < 0 ? Json(nullptr) : Json(report.exit_code);
  json["title"] = scene.title;
  json["scene"] = scene.file.string();
  json["heard"] = heard(report, scene);
  json["model"] = {{"dofs", report.model.dofs},
                   {"pairs", report.model.pairs},
                   {"elements", report.model.elements},
                   {"ranks", report.model.ranks},
                   {"memory_bytes", report.model.memory_bytes},
                   {"rounding_hz", report.model.rounding_hz}};
  add_coverage(report.model.coverage, scene, json["model"]);
  const double factor = std::max(report.transient.factor_seconds, report.motion.cycle.costs.factor_seconds);
  if (factor > 0) // A was factored: what one step size costs before the first step
  {
    json["model"]["factor_seconds"] = factor;
    json["model"]["condensed_operator_seconds"] =
        std::max(report.transient.condensed_seconds, report.motion.cycle.costs.condensed_seconds);
  }
  json[word(Stage::equilibrium)] = equilibrium_entry(report, scene);
  json[word(Stage::modes)] = modes_entry(report.point.modes);
  json[word(Stage::estimate)] = estimate_entry(followed_estimate(report));
  json[word(Stage::response)] = study_entry(report.response, scene, add_response);
  json[word(Stage::transient)] = transient_entry(report);
  json[word(Stage::coarse)] = coarse_entry(report.coarse);
  json[word(Stage::cycle)] = cycle_entry(report, scene);
  for (const Attempt& attempt : report.motion.attempts)
    json[word(Stage::cycle)]["attempts"].push_back(attempt_entry(attempt));
  json[word(Stage::settled)] = settled_entry(report, scene);
  json["fidelity"] = fidelity_entry(report.motion.fidelity);
  json[word(Stage::attractors)] = attractors_entry(report);
  json[word(Stage::branch)] = study_entry(report.branch, scene, add_branch);
  json[word(Stage::sensitivity)] = study_entry(report.sensitivity, scene, add_sensitivity);
  json[word(Stage::sweep)] = study_entry(report.sweep, scene, add_sweep);
  json[word(Stage::robustness)] = study_entry(report.robustness, scene, add_robustness);
  const Warnings warnings = warnings_of(report);
  const auto warn = [&json](Stage stage, const std::vector<std::string>& sentences)
  {
    if (!sentences.empty()) json[word(stage)]["warnings"] = sentences;
  };
  warn(Stage::model, report.model.warnings);
  warn(Stage::equilibrium, warnings.equilibrium);
  warn(Stage::modes, warnings.modes);
  warn(Stage::estimate, warnings.estimate);
  warn(Stage::response, warnings.response);
  warn(Stage::transient, warnings.transient);
  warn(Stage::cycle, warnings.cycle);
  for (const auto& [stage, seconds, processor_seconds] : report.timings)
  {
    json["timings"][word(stage)] = seconds;
    json["processor_seconds"][word(stage)] = processor_seconds;
  }
  Json libraries = Json::object();
  for (const auto& [name, version] : versions()) libraries[name] = version;
  json["versions"] = libraries;
  // Text from files of any encoding must not stop the report.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

} // namespace squeal
