#include "squeal/run.hpp"

#include "squeal/options.hpp"
#include "squeal/report/report.hpp"
#include "squeal/transient/step_guards.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <span>

namespace squeal
{

namespace
{

/// Runs one stage under its -log_view name, times it, and tells a person which one is at work.
template <class Work> auto timed(Report& report, const char* name, MPI_Comm comm, Work work)
{
  const LogStage log(name);
  if (rank_of(comm) == 0) std::printf("%s …\n", name), std::fflush(stdout);
  const double start = MPI_Wtime(), processor_start = processor_time();
  auto result = work();
  report.timings.push_back({name, MPI_Wtime() - start, processor_time() - processor_start});
  return result;
}

Outcome not_run(OutcomeKind kind, const std::string& reason)
{
  return {kind, reason, 0, 0};
}

/// Why a stage that follows an unstable mode cannot run; empty if it can.
std::string no_mode_to_follow(const Report& report)
{
  if (report.equilibrium.outcome.kind != OutcomeKind::converged) return "there is no equilibrium to start from";
  if (report.modes.modes.empty()) return "no mode was found in the band";
  if (report.modes.modes.front().growth_rate() <= 0) return "the equilibrium is stable: no mode grows in the band";
  if (report.modes.modes.front().frequency_hz() == 0) return "the equilibrium diverges without oscillating";
  return {};
}

/// The mode to follow, and every other one that grows: none may be left asleep.
std::span<const ComplexMode> growing_modes(const Report& report)
{
  return std::span(report.modes.modes).first(static_cast<std::size_t>(std::max(report.modes.unstable_count, 1)));
}

State transient_start(const TransientSettings& settings, const ComplexMode& mode, const Model& model,
                      const Report& report)
{
  if (settings.start.kind == StartKind::estimate)
  {
    State start = mode_state(report.equilibrium, mode, start_amplitude(report.estimate), report.estimate.phase);
    for (const State& other :
         estimated_motions(model.structure, model.interface, report.equilibrium, growing_modes(report).subspan(1)))
      add_motion(other, 1, start);
    return start;
  }
  if (settings.start.kind == StartKind::mode)
  {
    const double amplitude = settings.amplitude > 0 ? settings.amplitude : 0.1 * report.estimate.lift_off_amplitude;
    return mode_state(report.equilibrium, mode, amplitude, report.estimate.phase);
  }
  return read_state(settings.start.file, model.structure);
}

bool starts_on_a_mode(const TransientSettings& settings)
{
  return settings.start.kind != StartKind::file;
}

/// From a state file for so many steps, the transient needs no mode.
bool follows_a_mode(const TransientSettings& settings)
{
  return settings.enabled && (starts_on_a_mode(settings) || settings.steps == 0);
}

Estimate run_estimate(const Scene& scene, const Model& model, const Report& report)
{
  Estimate estimate;
  const bool needed = scene.estimate.enabled || scene.cycle.enabled || follows_a_mode(scene.transient);
  const std::string reason = no_mode_to_follow(report);
  if (!needed)
    estimate.outcome = not_run(OutcomeKind::off, "the scene turns it off");
  else if (!reason.empty())
    estimate.outcome = not_run(OutcomeKind::skipped, reason);
  else
    return estimate_amplitude(model.structure, model.interface, report.equilibrium, report.modes.modes.front());
  return estimate;
}

Trajectory run_transient(const Scene& scene, const Model& model, const Report& report)
{
  Trajectory trajectory;
  const bool from_file = !starts_on_a_mode(scene.transient);
  const std::string reason = no_mode_to_follow(report);
  if (!scene.transient.enabled)
    trajectory.outcome = not_run(OutcomeKind::off, "the scene has no [transient]");
  else if (report.equilibrium.outcome.kind != OutcomeKind::converged || (!reason.empty() && !from_file))
    trajectory.outcome = not_run(OutcomeKind::skipped, reason);
  else if (!reason.empty())
    return integrate(model.structure, model.interface, report.equilibrium, nullptr, scene.transient,
                     read_state(scene.transient.start.file, model.structure), model.probes);
  else
  {
    const ComplexMode& mode = report.modes.modes.front();
    const TransientSettings settings = planned(scene.transient, mode);
    return integrate(model.structure, model.interface, report.equilibrium, &mode, settings,
                     transient_start(settings, mode, model, report), model.probes);
  }
  return trajectory;
}

/// Of the shooting's own theta and steps a period.
std::string cycle_refusal(const Scene& scene, const Model& model, const Report& report)
{
  const ComplexMode& mode = report.modes.modes.front();
  const double period = 2 * std::numbers::pi / std::abs(mode.lambda.imag());
  return step_refusal(model.structure, &mode, scene.cycle.theta, period / scene.cycle.steps_per_period);
}

LimitCycle run_cycle(const Scene& scene, const CycleOptions& options, const Model& model, Report& report)
{
  LimitCycle cycle;
  const std::string reason = no_mode_to_follow(report);
  if (!scene.cycle.enabled)
    cycle.outcome = not_run(OutcomeKind::off, "the scene has no [cycle]");
  else if (!reason.empty())
    cycle.outcome = not_run(OutcomeKind::skipped, reason);
  else if (const std::string refusal = cycle_refusal(scene, model, report); !refusal.empty())
    cycle.outcome = not_run(OutcomeKind::refused, refusal);
  else
  {
    const CycleProblem problem{model.structure,       model.interface, report.equilibrium, report.modes.modes,
                               growing_modes(report), report.estimate, scene.cycle,        model.probes};
    FittedCycle fitted = find_fitted_cycle(problem, {scene.fidelity, scene.accuracy}, options);
    report.fidelity = fitted.fidelity;
    return std::move(fitted.cycle);
  }
  return cycle;
}

Modes run_modes(const Scene& scene, const Model& model, const Report& report)
{
  Modes modes;
  if (report.equilibrium.outcome.kind != OutcomeKind::converged)
    modes.outcome = not_run(OutcomeKind::skipped, "there is no equilibrium to linearise about");
  else if (!scene.modes.enabled && !scene.cycle.enabled && !follows_a_mode(scene.transient))
    modes.outcome = not_run(OutcomeKind::off, "the scene turns it off");
  else
    return find_modes(model.structure, model.interface, report.equilibrium, scene.modes);
  return modes;
}

/// What the model is, as far as it is known before anything is solved.
void describe_model(const Model& model, Report& report, MPI_Comm comm)
{
  check(MatGetSize(model.structure.K, &report.dofs, nullptr));
  report.elements = model.structure.elements;
  report.pairs = model.interface.pairs;
  report.ranks = ranks_of(comm);
  double stiffness = 0, mass = 0;
  check(MatNorm(model.structure.K, NORM_1, &stiffness));
  check(MatNorm(model.structure.M, NORM_1, &mass));
  if (mass > 0) report.rounding_hz = 1e-6 * std::sqrt(stiffness / mass) / (2 * std::numbers::pi);
  if (rank_of(comm) == 0)
    std::printf("  %d degrees of freedom, %d contact pairs, %ld elements, %d ranks\n", static_cast<int>(report.dofs),
                report.pairs, report.elements, report.ranks);
}

/// What the report tells of the equilibrium beside its own result: each contact's clamp force, its torque, the probes.
void describe_equilibrium(const Scene& scene, const Model& model, Report& report)
{
  if (report.equilibrium.outcome.kind != OutcomeKind::converged) return;
  const Interface& interface = model.interface;
  const auto directions = static_cast<std::size_t>(interface.directions);
  report.contact_forces.assign(scene.contacts.size(), 0);
  report.contact_torques.assign(scene.contacts.size(), 0);
  for (std::size_t i = 0; i < interface.contact.size(); ++i)
  {
    const auto contact = static_cast<std::size_t>(interface.contact[i]);
    const double* r = &report.equilibrium.reactions[i * (1 + directions)];
    report.contact_forces[contact] += r[0];
    if (const auto& rotation = scene.contacts[contact].rotation; rotation && rotation->rate != 0)
      for (std::size_t k = 0; k < directions; ++k)
        report.contact_torques[contact] += r[1 + k] * interface.drive[i * directions + k] / rotation->rate;
  }
  Owned<Vec> values;
  check(MatCreateVecs(model.probes, nullptr, values.put()));
  check(MatMult(model.probes, report.equilibrium.u, values));
  report.equilibrium_probes = whole(values);
}

std::vector<std::string> stages_run(const Report& report)
{
  std::vector<std::string> stages;
  const auto add = [&](const char* name, const Outcome& outcome)
  {
    if (has_run(outcome)) stages.emplace_back(name);
  };
  add("equilibrium", report.equilibrium.outcome);
  add("modes", report.modes.outcome);
  add("estimate", report.estimate.outcome);
  add("transient", report.transient.outcome);
  add("cycle", report.cycle.outcome);
  return stages;
}

/// A skipped stage is no failure by itself: the stage it waited for answers for it.
Verdict verdict_of(const Report& report)
{
  const bool all_good = succeeded(report.equilibrium.outcome) && succeeded(report.modes.outcome) &&
                        succeeded(report.estimate.outcome) && succeeded(report.transient.outcome) &&
                        succeeded(report.cycle.outcome);
  return all_good ? Verdict::converged : Verdict::not_converged;
}

} // namespace

Verdict run(const Scene& scene, const std::filesystem::path& output, MPI_Comm comm)
{
  Report report;
  CycleOptions cycle_options;
  read_options(options_of(cycle_options));
  const Model model = timed(report, "model", comm, [&] { return build_model(scene, comm); });
  describe_model(model, report, comm);

  report.equilibrium =
      timed(report, "equilibrium", comm, [&] { return find_equilibrium(model.structure, model.interface); });
  describe_equilibrium(scene, model, report);
  report.modes = timed(report, "modes", comm, [&] { return run_modes(scene, model, report); });
  report.estimate = timed(report, "estimate", comm, [&] { return run_estimate(scene, model, report); });
  report.transient = timed(report, "transient", comm, [&] { return run_transient(scene, model, report); });
  report.cycle = timed(report, "cycle", comm, [&] { return run_cycle(scene, cycle_options, model, report); });

  report.memory_bytes = peak_memory(comm);
  write_results(report, scene, model, output, comm);
  print_summary(report, scene, comm);
  if (rank_of(comm) == 0) std::printf("results are in %s\n", output.c_str());
  check_options_used(stages_run(report), comm);
  return verdict_of(report);
}

void dry_run(const Scene& scene, MPI_Comm comm)
{
  Report report;
  const Model model = build_model(scene, comm);
  if (rank_of(comm) == 0)
    std::printf("# the scene, every default written out\n%s\n# the model\n", resolved_scene(scene).c_str());
  describe_model(model, report, comm);
  const MemoryForecast memory = forecast_memory(model);
  if (rank_of(comm) == 0)
    std::printf("  memory forecast, all ranks together: matrices %.3g MB, one factorisation %.3g MB, condensed contact "
                "operator %.3g MB\n",
                1e-6 * memory.matrices, 1e-6 * memory.factor, 1e-6 * memory.condensed_operator);
}

} // namespace squeal
