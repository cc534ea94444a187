#include "squeal/run.hpp"

#include "squeal/base/free_memory.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/find_motion.hpp"
#include "squeal/forecast.hpp"
#include "squeal/mesh_error.hpp"
#include "squeal/scene/numbers.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace squeal
{

namespace
{

/// Runs a stage under its -log_view name, prints which one is at work, and adds its time, also where it is interrupted.
/// Where the run is asked to end, the stage is left out or ends, and the later ones are left out. Returns why the stage
/// has no result; empty if it has one.
std::string run_or_leave_out(Report& report, Stage which, MPI_Comm comm, const std::function<bool()>& work)
{
  if (!report.ended_by.empty()) return "the run was ended " + report.ended_by + " before";
  const char* const name = word(which);
  const Finally end = log_stage(name);
  if (rank_of(comm) == 0) std::printf("%s …\n", name), std::fflush(stdout);
  const double start = MPI_Wtime(), processor_start = processor_time();
  std::string left_out;
  try
  {
    if (work()) report.ended_by = who_asked_to_end();
  }
  catch (const Interrupted&)
  {
    report.ended_by = who_asked_to_end();
    left_out = "the run was ended " + report.ended_by + " in this stage";
  }
  return_freed_memory();
  auto& timings = report.timings;
  const auto known = std::ranges::find(timings, which, &Timing::stage); // the cycle may be sought twice
  Timing& timing = known == timings.end() ? timings.emplace_back(Timing{which}) : *known;
  timing.seconds += MPI_Wtime() - start;
  timing.processor_seconds += processor_time() - processor_start;
  return left_out;
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
  {
    double mass = 0;
    for (const PartMass& part : summary.parts) mass += part.mass;
    for (const std::string& doubt : doubts_about(scene, summary.length, mass)) summary.warnings.push_back(doubt);
  }
  return summary;
}

void print_end(const Report& report, const ResultsFolder& results, MPI_Comm comm)
{
  if (rank_of(comm) != 0) return;
  if (report.ended_by.empty())
    std::printf("results are in %s\n", results.place().c_str());
  else
    std::printf(
        "ended %s: results so far are in %s; the same command with --restart goes on from the last checkpoint\n",
        report.ended_by.c_str(), results.place().c_str());
}

/// Reads the files that stages start from, for their errors alone. Collective.
void check_starts(const Scene& scene, const Model& model)
{
  if (scene.transient.enabled && scene.transient.start.kind == StartKind::file)
    (void)read_state(scene.transient.start.file, model.structure);
  if (scene.cycle.enabled && scene.cycle.start.kind == CycleStartKind::file)
    (void)read_state(scene.cycle.start.file, model.structure);
}

/// Throws Error where the scene asks for a stage that does not know pairs without a drive yet.
void refuse_undriven_pairs(const Scene& scene, const Interface& interface)
{
  if (!has_undriven_pairs(interface)) return;
  std::size_t pair = 0;
  while (!is_undriven(interface, pair)) ++pair;
  const std::string contact =
      interface.geometry.empty()
          ? format("pair %zu of drive.petsc", pair)
          : "the contact of " + contact_names(scene)[static_cast<std::size_t>(interface.geometry[pair].contact)];
  const auto refuse = [&](bool asked, const char* stage, const char* remedy)
  {
    if (asked)
      throw Error(scene.file.string() + ": " + stage + " does not know pairs without a drive yet, and " + contact +
                  " has some: " + remedy + ", or give the contact a velocity, or friction = 0");
  };
  refuse(scene.sweep && scene.sweep->stages != SweepStages::equilibrium, "[sweep] of modes",
         "set sweep.stages = \"equilibrium\"");
  refuse(scene.sensitivity && !scene.friction.slipped_pairs_stick, "[sensitivity] of pairs that slide",
         "leave friction.slipped_pairs_stick out");
  refuse(scene.robustness.has_value(), "[robustness]", "take it out");
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

ExitCode run(Scene scene, const ProgramOptions& options, ResultsFolder& results, MPI_Comm comm)
{
  Report report;
  report.run = results.run();
  report.program = options.arguments.program;
  if (const int ranks = ranks_of(comm); ranks > 1) report.command = "mpirun -n " + std::to_string(ranks) + " ";
  report.command += options.arguments.command;
  report.place = results.place();
  const StageRunner runner = [&](Stage which, const std::function<bool()>& work)
  { return run_or_leave_out(report, which, comm, work); };
  Model model; // of the scene: scene/*_keys.cpp bind each key to its member, with what it changes
  if (!runner(Stage::model, [&] { return model = build_model(scene, comm), false; }).empty()) throw Interrupted{};
  report.model = summary_with_doubts(model, scene, comm);
  print_model(report.model, comm);
  refuse_undriven_pairs(scene, model.interface);
  check_starts(scene, model);
  end_if_asked(comm);
  const Forecast forecast = forecast_of(model, scene, options);
  if (rank_of(comm) == 0) std::printf("%s", factor_text(forecast).c_str());
  if (!options.arguments.force) agree(comm, problem_of(forecast, comm));

  const auto save = [&] { write_results(report, scene, model, results.partial(), comm); };
  const auto stage = [&](Stage which, auto& result, const auto& work)
  {
    result = run_stage(runner, which, why_off(which, report.point, scene), work);
    if (has_run(result.outcome)) save();
  };
  const SlidingPoint& point = report.point = find_sliding(model, options, runner);
  if (point.equilibrium.outcome.kind == OutcomeKind::converged)
  {
    report.contacts = contact_resultants(model.interface, point.equilibrium.reactions, scene.contacts);
    report.displacement = norm_of(point.equilibrium.u, NORM_INFINITY);
    report.equilibrium_probes = probe_values(model.probes, point.equilibrium.u);
    add_shifts(scene, model, report.equilibrium_probes);
    for (const TightBolt& bolt : model.structure.bolts)
      report.bolts.push_back({bolt.name, tension_of(bolt, point.equilibrium.u), bolt.shortening});
  }
  save();
  report.point = with_small_motions(std::move(report.point), scene, options, runner);
  if (scene.modes.mesh_error == MeshErrorMethod::refinement)
    runner(Stage::modes, [&] { return report.point.mesh_error = find_mesh_error(point, scene, options), false; });
  save();
  stage(Stage::response, report.response, [&] { return run_response(point, scene, options); });
  stage(Stage::transient, report.transient, [&] { return find_transient(point, scene, options); });
  const MotionStart start = motion_start(point, scene, report.transient);
  const Motion& motion = report.motion = find_motion(point, start, scene, options, runner);
  save();
  stage(Stage::attractors, report.attractors, [&] { return run_attractors(point, motion, scene, options); });
  stage(Stage::branch, report.branch, [&] { return run_branch(point, motion, scene, options); });
  stage(Stage::sensitivity, report.sensitivity, [&] { return run_sensitivity(point, scene, options); });
  stage(Stage::sweep, report.sweep, [&] { return run_scene_sweep(model, scene, options); });
  stage(Stage::robustness, report.robustness, [&] { return run_robustness(model, scene, options); });

  const ExitCode code = exit_code_of(report);
  report.exit_code = static_cast<int>(code);
  report.model.memory_bytes = peak_memory(comm);
  if (code != ExitCode::interrupted) check_options_used(stages_run(report), comm);
  save();
  results.publish(code == ExitCode::interrupted ? Checkpoints::kept : Checkpoints::removed);
  print_table(report, scene, options.arguments.verbose ? TableLength::full : TableLength::brief, comm);
  print_end(report, results, comm);
  return code;
}

void dry_run(Scene scene, const ProgramOptions& options, MPI_Comm comm)
{
  const Model model = build_model(scene, comm);
  print_model(summary_with_doubts(model, scene, comm), comm);
  refuse_undriven_pairs(scene, model.interface);
  check_starts(scene, model);
  const Forecast forecast = forecast_of(model, scene, options);
  if (rank_of(comm) == 0) std::printf("%s", text_of(forecast).c_str());
  const std::string problem = problem_of(forecast, comm);
  if (rank_of(comm) == 0 && !problem.empty()) std::printf("  WARNING: here %s\n", problem.c_str());
  if (rank_of(comm) == 0 && options.arguments.resolve)
    std::printf("# the scene, every default written out\n%s", resolved_scene(scene).c_str());
}

} // namespace squeal
