#include "squeal/run.hpp"

#include "squeal/base/free_memory.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/branch/brake_branch.hpp"
#include "squeal/chain.hpp"
#include "squeal/cycle/fidelity.hpp"
#include "squeal/forecast.hpp"
#include "squeal/reduction/model_files.hpp"
#include "squeal/scene/doubts.hpp"
#include "squeal/study/robustness.hpp"
#include "squeal/study/sensitivity.hpp"
#include "squeal/study/sweep.hpp"
#include "squeal/swept_motion.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>

namespace squeal
{

namespace
{

/// Adds the time of its life to a stage's, also where the stage is interrupted.
class StageClock
{
public:
  StageClock(Report& report, Stage which) : report_(report), which_(which) {}
  StageClock(const StageClock&) = delete;
  StageClock& operator=(const StageClock&) = delete;
  ~StageClock()
  {
    auto& timings = report_.timings;
    const auto known = std::ranges::find(timings, which_, &Timing::stage); // the cycle may be sought twice
    Timing& timing = known == timings.end() ? timings.emplace_back(Timing{which_}) : *known;
    timing.seconds += MPI_Wtime() - start_;
    timing.processor_seconds += processor_time() - processor_start_;
  }

private:
  Report& report_;
  Stage which_;
  double start_ = MPI_Wtime(), processor_start_ = processor_time();
};

/// Runs one stage under its -log_view name, times it, and prints which one is at work.
template <class Work> auto timed(Report& report, Stage which, MPI_Comm comm, Work work)
{
  const char* const name = word(which);
  const LogStage log(name);
  if (rank_of(comm) == 0) std::printf("%s …\n", name), std::fflush(stdout);
  const StageClock clock(report, which);
  auto result = work();
  return_freed_memory();
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

/// Whether the run was asked to end in a stage whose result stays.
template <class Result> bool was_cut_short(Result& result)
{
  return outcome_of(result).kind == OutcomeKind::interrupted;
}

bool was_cut_short(FittedCycle& fitted)
{
  return fitted.cycle.cut_short;
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
    if (was_cut_short(result)) report.ended_by = who_asked_to_end();
  }
  catch (const Interrupted&)
  {
    result = {};
    report.ended_by = who_asked_to_end();
    leave_out(" in this stage");
  }
  return result;
}

BrakeBranch run_branch(const Chain& chain)
{
  const Scene& scene = chain.scene;
  const Report& report = chain.report;
  if (!scene.branch) return not_run<BrakeBranch>(OutcomeKind::off, "the scene has no [branch]");
  const double tolerance = scene.cycle.tolerance > 0 ? scene.cycle.tolerance : plain_tolerance;
  const std::string reason = no_cycle_to_follow(report.cycle, tolerance);
  if (!reason.empty()) return not_run<BrakeBranch>(OutcomeKind::skipped, reason);
  NearbyModels models(chain.model, scene, comm_of(chain.model.structure.load));
  const auto model_at = [&](double parameter) {
    return models.at(std::array{SceneNumber{scene.branch->key, parameter}});
  };
  return find_branch({*scene.branch, model_at, chain.sliding(), report.cycle, report.modes.modes, scene.fidelity,
                      steps_along_branch(scene.cycle, report.cycle), tolerance, chain.model.probes, scene.modes,
                      chain.options.modes, chain.options.equilibrium, chain.options.step,
                      chain.options.cycle.shooting});
}

Sensitivity run_sensitivity(const Chain& chain)
{
  const Scene& scene = chain.scene;
  if (!scene.sensitivity) return not_run<Sensitivity>(OutcomeKind::off, "the scene has no [sensitivity]");
  const std::string reason = no_unstable_mode(chain.report);
  if (!reason.empty()) return not_run<Sensitivity>(OutcomeKind::skipped, reason);
  if (chain.model.structure.H.get())
    return not_run<Sensitivity>(OutcomeKind::refused, "the structure has a circulatory part");
  NearbyModels models(chain.model, scene, comm_of(chain.model.structure.load));
  const auto model_at = [&](std::span<const SceneNumber> numbers)
  {
    std::vector<SceneNumber> all;
    for (const SceneNumber& number : numbers) std::ranges::copy(from_zero(scene, number), std::back_inserter(all));
    return models.at(all);
  };
  std::vector<int> probes;
  for (const Change& change : scene.changes)
    probes.push_back(
        static_cast<int>(std::ranges::find(scene.probes, change.probe, &Probe::name) - scene.probes.begin()));
  return find_sensitivity({chain.sliding(), *chain.linearised, chain.report.modes, sensitive_numbers(scene),
                           components_of(scene), contact_names(scene), model_at, chain.model.probes, scene.changes,
                           probes, scene.modes, chain.options.modes, chain.options.equilibrium});
}

Sweep run_scene_sweep(const Chain& chain)
{
  const Scene& scene = chain.scene;
  if (!scene.sweep) return not_run<Sweep>(OutcomeKind::off, "the scene has no [sweep]");
  if (chain.model.structure.H.get() && scene.sweep->directions == SweepDirections::both)
    return not_run<Sweep>(OutcomeKind::refused, "what the circulatory part of given matrices becomes in the other "
                                                "direction of rotation is not known, as another code's friction is "
                                                "in the symmetric part of K as well: sweep one direction, and the "
                                                "other one with matrices of its own");
  std::optional<NearbyModels> models; // of the group of ranks that this one is in
  const auto models_on = [&](MPI_Comm comm) -> NearbyModels&
  { return models && models->comm() == comm ? *models : models.emplace(chain.model, scene, comm); };
  const auto model_at = [&](std::span<const double> values, MPI_Comm comm)
  { return models_on(comm).at(numbers_of(scene.sweep->key, values)); };
  const auto motion_at = [&](const SweptPlace& place, MPI_Comm comm)
  { return find_swept_motion(chain, place, models_on(comm)); };
  return run_sweep({*scene.sweep, model_at, motion_at, scene.modes, chain.options.modes, chain.options.equilibrium,
                    chain.options.sweep},
                   comm_of(chain.model.structure.load));
}

Robustness run_robustness(const Chain& chain)
{
  const Scene& scene = chain.scene;
  if (!scene.robustness) return not_run<Robustness>(OutcomeKind::off, "the scene has no [robustness]");
  NearbyModels models(chain.model, scene, PETSC_COMM_SELF);
  std::vector<std::string> keys;
  for (const UncertainNumber& number : scene.uncertain) keys.push_back(number.key);
  const auto model_at = [&](std::span<const double> values) { return models.at(numbers_of(keys, values)); };
  return find_robustness({*scene.robustness, scene.uncertain, model_at, scene.friction, scene.modes,
                          chain.options.modes, chain.options.equilibrium},
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

/// The summary with the warnings that follow from the scene, on rank 0.
ModelSummary summary_with_doubts(const Model& model, const Scene& scene, MPI_Comm comm)
{
  ModelSummary summary = summary_of(model, scene, comm);
  if (rank_of(comm) == 0)
    for (const std::string& doubt : doubts_about(scene, summary.length)) summary.warnings.push_back(doubt);
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

/// The coarse mesh of the scene's start, if it has one. Collective.
void make_coarse_model(const Scene& scene, const Model& model, MPI_Comm comm, std::optional<CoarseModel>& coarse)
{
  if (!scene.cycle.enabled || scene.cycle.start.kind != CycleStartKind::coarse) return;
  coarse.emplace(scene, model, comm);
  if (rank_of(comm) == 0)
    std::printf("  coarse mesh: %lld degrees of freedom, %d contact pairs\n",
                static_cast<long long>(coarse->model.dofs.size), coarse->model.interface.pairs);
}

/// The state that the search for the cycle starts from, if it is a file. That of the transient is read for its errors
/// alone. Collective.
std::optional<State> read_start_files(const Scene& scene, const Structure& structure)
{
  if (scene.transient.enabled && scene.transient.start.kind == StartKind::file)
    (void)read_state(scene.transient.start.file, structure);
  if (!scene.cycle.enabled || scene.cycle.start.kind != CycleStartKind::file) return {};
  return read_state(scene.cycle.start.file, structure);
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
  std::optional<CoarseModel> coarse;
  make_coarse_model(scene, model, comm, coarse);
  std::optional<State> cycle_file = read_start_files(scene, model.structure);
  end_if_asked(comm);
  const Forecast forecast = forecast_of(model, scene, options, SpeedTaken::usual);
  if (rank_of(comm) == 0) std::printf("%s", factor_text(forecast).c_str());
  if (!options.force) agree(comm, problem_of(forecast, comm));

  Chain chain{scene, options, model, report, {}};
  chain.cycle_file = std::move(cycle_file);
  if (coarse) chain.coarse = &*coarse;
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
  report.response = stage(report, Stage::response, comm, [&] { return run_response(chain); });
  if (has_run(report.modes.outcome) || has_run(report.response.outcome)) save();
  if (scene.modes.reduced_matrices && !report.modes.modes.empty())
    write_reduced_matrices(chain.sliding(), report.modes.modes, options.step.factor,
                           results.partial() / word(ResultFile::reduced));
  report.transient = stage(report, Stage::transient, comm, [&] { return run_transient(chain); });
  if (has_run(report.transient.outcome)) save();
  if (coarse)
    report.coarse = stage(report, Stage::coarse, comm, [&] { return run_coarse(chain); });
  else
    report.coarse = not_run<CoarseStart>(OutcomeKind::off, "the scene has no cycle.start = \"coarse\"");
  seek_motion(chain,
              [&](Stage which, const auto& work)
              {
                if (which == Stage::settled && has_run(report.cycle.outcome)) save(); // the cycle is in the report
                return stage(report, which, comm, work);
              });
  if (has_run(report.settled.outcome)) save();
  report.attractors = stage(report, Stage::attractors, comm, [&] { return run_attractors(chain); });
  if (has_run(report.attractors.outcome)) save();
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
  std::optional<CoarseModel> coarse;
  make_coarse_model(scene, model, comm, coarse);
  (void)read_start_files(scene, model.structure);
  const Forecast forecast = forecast_of(model, scene, options, SpeedTaken::measured);
  if (rank_of(comm) == 0) std::printf("%s", text_of(forecast).c_str());
  const std::string problem = problem_of(forecast, comm);
  if (rank_of(comm) == 0 && !problem.empty()) std::printf("  WARNING: here %s\n", problem.c_str());
}

} // namespace squeal
