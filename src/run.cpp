#include "squeal/run.hpp"

#include "squeal/attractors/attractors.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/branch/brake_branch.hpp"
#include "squeal/cycle/fidelity.hpp"
#include "squeal/cycle/period_log.hpp"
#include "squeal/forecast.hpp"
#include "squeal/report/report.hpp"
#include "squeal/scene/doubts.hpp"
#include "squeal/study/robustness.hpp"
#include "squeal/study/sensitivity.hpp"
#include "squeal/study/sweep.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>

namespace squeal
{

namespace
{

/// The chain so far. Stages never call the next one: what they hand on stands here.
struct Chain
{
  const Scene& scene;
  const ProgramOptions& options;
  const Model& model;
  Report& report;
  std::optional<LinearisedSliding> linearised; // once there is an equilibrium and a stage needs it
  std::optional<State> cycle_file{}; // the state that the scene starts the cycle's search from, if it is a file

  SlidingEquilibrium sliding() const { return {model.structure, model.interface, report.equilibrium}; }
  UnstableModes unstable() const { return {report.modes.unstable(), report.estimates}; }
};

/// Runs one stage under its -log_view name, times it, and prints which one is at work.
template <class Work> auto timed(Report& report, Stage which, MPI_Comm comm, Work work)
{
  const char* const name = word(which);
  const LogStage log(name);
  if (rank_of(comm) == 0) std::printf("%s …\n", name), std::fflush(stdout);
  const double start = MPI_Wtime(), processor_start = processor_time();
  auto result = work();
  report.timings.push_back({which, MPI_Wtime() - start, processor_time() - processor_start});
  return result;
}

template <class Result> Outcome& outcome_of(Result& result)
{
  return result.outcome;
}

Outcome& outcome_of(FittedCycle& fitted)
{
  return fitted.cycle.outcome;
}

Outcome& outcome_of(std::vector<Estimate>& estimates)
{
  return estimates.empty() ? estimates.emplace_back().outcome : estimates.front().outcome;
}

/// Runs one stage of the chain. Where the run is asked to end, the stage is left out or ends, and the later ones are
/// left out.
template <class Work> auto stage(Report& report, Stage which, MPI_Comm comm, Work work)
{
  decltype(work()) result;
  const auto leave_out = [&](const std::string& when) {
    outcome_of(result) = {OutcomeKind::skipped, "the run was ended " + report.ended_by + when, 0, 0};
  };
  if (!report.ended_by.empty())
  {
    leave_out(" before");
    return result;
  }
  try
  {
    result = timed(report, which, comm, work);
    if (outcome_of(result).kind == OutcomeKind::interrupted) report.ended_by = who_asked_to_end();
  }
  catch (const Interrupted&)
  {
    if (rank_of(comm) == 0) keep_period_log();
    result = {};
    report.ended_by = who_asked_to_end();
    leave_out(" in this stage");
  }
  return result;
}

template <class Result> Result not_run(OutcomeKind kind, const std::string& reason)
{
  Result result;
  result.outcome = {kind, reason, 0, 0};
  return result;
}

/// Why a stage that follows an unstable mode cannot run; empty if it can.
std::string no_mode_to_follow(const Report& report)
{
  if (report.equilibrium.outcome.kind != OutcomeKind::converged) return "there is no equilibrium to start from";
  if (report.modes.modes.empty()) return "no mode was found in the band";
  if (report.modes.unstable_count == 0) return "the equilibrium is stable: no mode grows in the band";
  if (report.modes.modes.front().frequency_hz() == 0) return "the equilibrium diverges without oscillating";
  return {};
}

bool starts_from_file(const TransientSettings& settings)
{
  return settings.start.kind == StartKind::file;
}

/// From a state file for a given number of steps, the transient needs no mode.
bool follows_a_mode(const TransientSettings& settings)
{
  return settings.enabled && (!starts_from_file(settings) || settings.steps == 0);
}

Modes run_modes(Chain& chain)
{
  const Scene& scene = chain.scene;
  if (chain.report.equilibrium.outcome.kind != OutcomeKind::converged)
    return not_run<Modes>(OutcomeKind::skipped, "there is no equilibrium to linearise about");
  if (!scene.modes.enabled && !scene.cycle.enabled && !follows_a_mode(scene.transient))
    return not_run<Modes>(OutcomeKind::off, "the scene turns it off");
  chain.linearised = linearise(chain.sliding());
  return find_modes(chain.sliding(), *chain.linearised, scene.modes, chain.options.modes);
}

/// Of every unstable mode, the followed one first; of none, the reason.
std::vector<Estimate> run_estimates(const Chain& chain)
{
  const Scene& scene = chain.scene;
  std::vector<Estimate> estimates;
  const std::string reason = no_mode_to_follow(chain.report);
  if (!scene.estimate.enabled && !scene.cycle.enabled && !follows_a_mode(scene.transient))
    estimates.push_back(not_run<Estimate>(OutcomeKind::off, "the scene turns it off"));
  else if (!reason.empty())
    estimates.push_back(not_run<Estimate>(OutcomeKind::skipped, reason));
  else if (chain.model.interface.pairs == 0)
    estimates.push_back(not_run<Estimate>(OutcomeKind::skipped, "there is no contact that would limit the growth"));
  else
    for (const ComplexMode& mode : chain.report.modes.unstable())
      estimates.push_back(estimate_amplitude(chain.sliding(), *chain.linearised, mode, chain.options.estimate));
  return estimates;
}

Trajectory run_transient(const Chain& chain)
{
  const TransientSettings& settings = chain.scene.transient;
  const std::string reason = no_mode_to_follow(chain.report);
  if (!settings.enabled) return not_run<Trajectory>(OutcomeKind::off, "the scene has no [transient], or turns it off");
  if (chain.report.equilibrium.outcome.kind != OutcomeKind::converged ||
      (!reason.empty() && !starts_from_file(settings)))
    return not_run<Trajectory>(OutcomeKind::skipped, reason);
  const ComplexMode* followed = reason.empty() ? &chain.report.modes.modes.front() : nullptr;
  return integrate(chain.sliding(), followed, settings, chain.options.step,
                   transient_start(chain.sliding(), chain.unstable(), settings), chain.model.probes);
}

/// The state that the cycle's search starts from, where it is none of the modes'.
const State* given_start(const Chain& chain)
{
  if (chain.cycle_file) return &*chain.cycle_file;
  return chain.scene.cycle.start.kind == CycleStartKind::transient ? &chain.report.transient.end : nullptr;
}

/// Why the search for the cycle cannot run; empty if it can.
std::string no_cycle_start(const Chain& chain)
{
  const std::string reason = no_mode_to_follow(chain.report);
  if (!reason.empty() || chain.scene.cycle.start.kind != CycleStartKind::transient) return reason;
  const bool ended = chain.report.transient.outcome.kind == OutcomeKind::completed;
  return ended ? "" : "the transient that it starts from the end of was not completed";
}

CycleProblem cycle_problem(const Chain& chain)
{
  return {chain.sliding(),    *chain.linearised,   chain.report.modes.modes, chain.unstable(),  chain.scene.cycle,
          chain.options.step, chain.options.modes, chain.model.probes,       given_start(chain)};
}

FittedCycle run_cycle(const Chain& chain)
{
  const Scene& scene = chain.scene;
  FittedCycle result;
  const std::string reason = no_cycle_start(chain);
  if (!scene.cycle.enabled)
    result.cycle = not_run<LimitCycle>(OutcomeKind::off, "the scene has no [cycle], or turns it off");
  else if (!reason.empty())
    result.cycle = not_run<LimitCycle>(OutcomeKind::skipped, reason);
  else
    result = find_fitted_cycle(cycle_problem(chain), {scene.fidelity, scene.accuracy}, chain.options.cycle);
  return result;
}

/// Whether the search for a cycle ended without one that attracts, on a free motion that goes on.
bool motion_goes_on(const LimitCycle& cycle)
{
  return cycle.outcome.kind != OutcomeKind::collapsed_to_equilibrium && cycle.free.state.get();
}

/// What the motion settles on where no cycle attracts.
SettledMotion run_settled(const Chain& chain)
{
  const LimitCycle& cycle = chain.report.cycle;
  if (!has_run(cycle.outcome)) return not_run<SettledMotion>(OutcomeKind::off, "no cycle was sought");
  if (succeeded(cycle.outcome)) return not_run<SettledMotion>(OutcomeKind::skipped, "the cycle is the answer");
  if (!motion_goes_on(cycle)) return not_run<SettledMotion>(OutcomeKind::skipped, "there is no motion to go on from");
  return find_settled_motion(cycle_problem(chain), cycle, chain.options.settled);
}

/// A settled motion answers where no cycle does.
void accept_settled_motion(Report& report)
{
  Outcome& outcome = report.cycle.outcome;
  if (report.settled.outcome.kind != OutcomeKind::settled) return;
  outcome.reason = std::string(word(outcome.kind)) + ": " + outcome.reason;
  outcome.kind = OutcomeKind::settled;
}

Attractors run_attractors(const Chain& chain)
{
  const CycleSettings& settings = chain.scene.cycle;
  if (!settings.enabled || settings.starts == 0)
    return not_run<Attractors>(OutcomeKind::off, "the scene has no cycle.starts");
  const std::string reason = no_mode_to_follow(chain.report);
  if (!reason.empty()) return not_run<Attractors>(OutcomeKind::skipped, reason);
  CycleSettings used = settings;
  if (used.steps_per_period == 0)
    used.steps_per_period = first_steps; // the step's error of the energy is then about a percent
  return find_attractors({chain.sliding(), chain.report.modes.modes, chain.unstable(), used, chain.options.step},
                         chain.options.attractors);
}

/// Why no branch can start from the cycle; empty if it can.
std::string no_cycle_to_follow(const LimitCycle& cycle, double tolerance)
{
  if (!has_run(cycle.outcome) || !cycle.orbit.state.get()) return "there is no cycle to start from";
  // one that repels is a cycle as well
  if (cycle.outcome.kind != OutcomeKind::converged && !(cycle.orbit.residual <= tolerance))
    return "the cycle to start from did not converge";
  return {};
}

BrakeBranch run_branch(const Chain& chain)
{
  const Scene& scene = chain.scene;
  const Report& report = chain.report;
  if (!scene.branch) return not_run<BrakeBranch>(OutcomeKind::off, "the scene has no [branch]");
  const double tolerance = scene.cycle.tolerance > 0 ? scene.cycle.tolerance : plain_tolerance;
  const int steps = scene.cycle.steps_per_period;
  const std::string reason = no_cycle_to_follow(report.cycle, tolerance);
  if (!reason.empty()) return not_run<BrakeBranch>(OutcomeKind::skipped, reason);
  const auto model_at = [&](double parameter)
  {
    Model model = rebuild_model(chain.model, scene_with(scene, std::array{SceneNumber{scene.branch->key, parameter}}),
                                comm_of(chain.model.structure.load));
    return BranchModel{std::move(model.structure), std::move(model.interface)};
  };
  return find_branch({*scene.branch, model_at, chain.sliding(), report.cycle,
                      steps > 0 ? steps : std::min(report.cycle.steps_per_period, 128), tolerance, chain.model.probes,
                      scene.modes, chain.options.modes, chain.options.equilibrium, chain.options.step,
                      chain.options.cycle.shooting});
}

/// Why left vectors and sweeps are refused; empty if they are not.
std::string unsymmetric_part(const Structure& structure)
{
  if (structure.G.get() || structure.H.get()) return "the structure has gyroscopic or circulatory parts";
  return structure.K_loss.get() ? "parts have loss factors" : "";
}

Sensitivity run_sensitivity(const Chain& chain)
{
  const Scene& scene = chain.scene;
  if (!scene.sensitivity) return not_run<Sensitivity>(OutcomeKind::off, "the scene has no [sensitivity]");
  const std::string reason = no_mode_to_follow(chain.report), part = unsymmetric_part(chain.model.structure);
  if (!reason.empty()) return not_run<Sensitivity>(OutcomeKind::skipped, reason);
  if (!part.empty()) return not_run<Sensitivity>(OutcomeKind::refused, part);
  const MPI_Comm comm = comm_of(chain.model.structure.load);
  const auto model_with = [&](const SceneNumber& number)
  {
    Model model = rebuild_model(chain.model, scene_with(scene, std::span(&number, 1)), comm);
    return BranchModel{std::move(model.structure), std::move(model.interface)};
  };
  std::vector<int> probes;
  for (const Change& change : scene.changes)
    probes.push_back(
        static_cast<int>(std::ranges::find(scene.probes, change.probe, &Probe::name) - scene.probes.begin()));
  return find_sensitivity({chain.sliding(), *chain.linearised, chain.report.modes, sensitive_numbers(scene), model_with,
                           chain.model.probes, scene.changes, probes, scene.modes, chain.options.modes,
                           chain.options.equilibrium});
}

Sweep run_scene_sweep(const Chain& chain)
{
  const Scene& scene = chain.scene;
  if (!scene.sweep) return not_run<Sweep>(OutcomeKind::off, "the scene has no [sweep]");
  const std::string part = unsymmetric_part(chain.model.structure);
  if (!part.empty()) return not_run<Sweep>(OutcomeKind::refused, part);
  const MPI_Comm comm = comm_of(chain.model.structure.load);
  const auto model_at = [&](std::span<const double> values)
  {
    std::vector<SceneNumber> numbers;
    for (std::size_t i = 0; i < values.size(); ++i) numbers.push_back({scene.sweep->key[i], values[i]});
    Model model = rebuild_model(chain.model, scene_with(scene, numbers), comm);
    return BranchModel{std::move(model.structure), std::move(model.interface)};
  };
  return run_sweep(
      {*scene.sweep, model_at, scene.modes, chain.options.modes, chain.options.equilibrium, chain.options.sweep}, comm);
}

Robustness run_robustness(const Chain& chain)
{
  const Scene& scene = chain.scene;
  if (!scene.robustness) return not_run<Robustness>(OutcomeKind::off, "the scene has no [robustness]");
  const std::string part = unsymmetric_part(chain.model.structure);
  if (!part.empty()) return not_run<Robustness>(OutcomeKind::refused, part);
  const auto model_at = [&](std::span<const double> values)
  {
    std::vector<SceneNumber> numbers;
    for (std::size_t i = 0; i < values.size(); ++i) numbers.push_back({scene.uncertain[i].key, values[i]});
    Model model = rebuild_model(chain.model, scene_with(scene, numbers), PETSC_COMM_SELF);
    return BranchModel{std::move(model.structure), std::move(model.interface)};
  };
  return find_robustness({*scene.robustness, scene.uncertain, model_at, scene.friction, scene.modes,
                          chain.options.modes, chain.options.equilibrium, chain.options.robustness},
                         comm_of(chain.model.structure.load));
}

std::vector<Stage> stages_run(const Report& report)
{
  std::vector<Stage> stages;
  for (const auto& [which, outcome] : outcomes_of(report))
    if (has_run(outcome)) stages.push_back(which);
  return stages;
}

ExitCode exit_code_of(const Report& report)
{
  if (!report.ended_by.empty()) return ExitCode::interrupted;
  for (const auto& [which, outcome] : outcomes_of(report))
    if (!succeeded(outcome)) return ExitCode::not_converged;
  return ExitCode::converged;
}

/// The summary with the warnings that follow from the scene.
ModelSummary summary_with_doubts(const Model& model, const Scene& scene, MPI_Comm comm)
{
  ModelSummary summary = summary_of(model, scene, comm);
  for (const std::string& doubt : doubts_about(scene)) summary.warnings.push_back(doubt);
  return summary;
}

void print_end(const Report& report, const ResultsFolder& results, MPI_Comm comm)
{
  if (rank_of(comm) != 0) return;
  if (report.ended_by.empty())
    std::printf("results are in %s\n", results.place().c_str());
  else
    std::printf("ended %s: results so far are in %s; the same command with --restart goes on from there\n",
                report.ended_by.c_str(), results.place().c_str());
}

void print_model(const ModelSummary& model, MPI_Comm comm)
{
  if (rank_of(comm) == 0)
    std::printf("  %lld degrees of freedom, %d contact pairs, %ld elements, %d ranks\n",
                static_cast<long long>(model.dofs), model.pairs, model.elements, model.ranks);
  for (const std::string& warning : model.warnings)
    if (rank_of(comm) == 0) std::printf("  WARNING: %s\n", warning.c_str());
}

} // namespace

ExitCode run(const Scene& scene, const ProgramOptions& options, ResultsFolder& results, MPI_Comm comm)
{
  Report report;
  report.run = results.run();
  const Model model = timed(report, Stage::model, comm, [&] { return build_model(scene, comm); });
  report.model = summary_with_doubts(model, scene, comm);
  print_model(report.model, comm);
  if (!options.force) agree(comm, problem_of(forecast_of(model, scene, options), comm));
  end_if_asked(comm);

  Chain chain{scene, options, model, report, {}};
  if (scene.cycle.enabled && scene.cycle.start.kind == CycleStartKind::file)
    chain.cycle_file = read_state(scene.cycle.start.file, model.structure);
  const FieldNodes nodes{model.mesh, model.dofs, model.structure, model.interface};
  const auto save = [&] { write_results(report, scene, nodes, results.partial(), comm); };
  report.equilibrium = stage(report, Stage::equilibrium, comm,
                             [&] { return find_equilibrium(model.structure, model.interface, options.equilibrium); });
  if (report.equilibrium.outcome.kind == OutcomeKind::converged)
  {
    report.contacts = contact_resultants(model.interface, report.equilibrium.reactions, scene.contacts);
    report.equilibrium_probes = probe_values(model.probes, report.equilibrium.u);
  }
  save();
  report.modes = stage(report, Stage::modes, comm, [&] { return run_modes(chain); });
  report.estimates = stage(report, Stage::estimate, comm, [&] { return run_estimates(chain); });
  if (has_run(report.modes.outcome)) save();
  report.transient = stage(report, Stage::transient, comm, [&] { return run_transient(chain); });
  if (has_run(report.transient.outcome)) save();
  FittedCycle fitted = stage(report, Stage::cycle, comm, [&] { return run_cycle(chain); });
  report.cycle = std::move(fitted.cycle);
  report.fidelity = std::move(fitted.fidelity);
  if (has_run(report.cycle.outcome)) save();
  report.settled = stage(report, Stage::settled, comm, [&] { return run_settled(chain); });
  accept_settled_motion(report);
  if (has_run(report.settled.outcome)) save();
  report.attractors = stage(report, Stage::attractors, comm, [&] { return run_attractors(chain); });
  if (has_run(report.attractors.outcome)) save();
  if (checkpoint_is_worth_it(comm) && rank_of(comm) == 0) keep_period_log();
  report.branch = stage(report, Stage::branch, comm, [&] { return run_branch(chain); });
  if (has_run(report.branch.outcome)) save();
  report.sensitivity = stage(report, Stage::sensitivity, comm, [&] { return run_sensitivity(chain); });
  if (has_run(report.sensitivity.outcome)) save();
  report.sweep = stage(report, Stage::sweep, comm, [&] { return run_scene_sweep(chain); });
  if (has_run(report.sweep.outcome)) save();
  report.robustness = stage(report, Stage::robustness, comm, [&] { return run_robustness(chain); });

  const ExitCode code = exit_code_of(report);
  report.exit_code = static_cast<int>(code);
  report.model.memory_bytes = peak_memory(comm);
  if (code != ExitCode::interrupted) check_options_used(stages_run(report), comm);
  save();
  results.publish(code == ExitCode::interrupted ? Checkpoints::published : Checkpoints::removed);
  print_table(report, scene, comm);
  print_end(report, results, comm);
  return code;
}

void dry_run(const Scene& scene, const ProgramOptions& options, MPI_Comm comm)
{
  const Model model = build_model(scene, comm);
  if (rank_of(comm) == 0)
    std::printf("# the scene, every default written out\n%s\n# the model\n", resolved_scene(scene).c_str());
  print_model(summary_with_doubts(model, scene, comm), comm);
  const Forecast forecast = forecast_of(model, scene, options);
  if (rank_of(comm) == 0) std::printf("%s", text_of(forecast).c_str());
  const std::string problem = problem_of(forecast, comm);
  if (rank_of(comm) == 0 && !problem.empty()) std::printf("  WARNING: here %s\n", problem.c_str());
}

} // namespace squeal
