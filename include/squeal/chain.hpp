#pragma once
/// The chain of stages on one model: modes, estimate, transient, cycle, settled motion, motions of many starts. Each
/// stage takes what the ones before it left, and says why it does not run. All of them are collective.
#include "squeal/coarse.hpp"
#include "squeal/options.hpp"
#include "squeal/report/report.hpp"

namespace squeal
{

/// The unstable modes. Where none is, and the cycle is sought from a state that the scene gives, the one that decays
/// slowest: a cycle may attract beside a stable equilibrium.
std::span<const ComplexMode> followed_modes(const Report& report, const Scene& scene);

/// What the search for a cycle follows where the equilibrium diverges without oscillating: the mode that diverges, with
/// a frequency that it does not have. A motion that has left the equilibrium far behind is paced by it.
struct PacedDivergence
{
  ComplexMode mode; // its eigenvalue is imaginary
  Estimate none;    // of no amplitude
  State start;      // beside the equilibrium
};

/// What the motion had settled on at fewer steps a period.
struct SettledBySteps
{
  MotionKind kind = MotionKind::undecided;
  MeanValue energy;   // [J] fluctuating
  MeanValue exponent; // a period, the largest
};

/// The chain so far. Stages never call the next one: what they hand on stands here.
struct Chain
{
  const Scene& scene;
  const ProgramOptions& options;
  const Model& model;
  Report& report;
  std::optional<LinearisedSliding> linearised; // once there is an equilibrium and a stage needs it
  std::optional<State> cycle_file{};      // the state that the scene starts the cycle's search from, if it is a file
  const CoarseModel* coarse = nullptr;    // of cycle.start = "coarse"
  std::optional<CarriedCycle> carried{};  // its cycle, on this mesh; or that on which the motion has settled
  std::optional<PacedDivergence> paced{}; // where no unstable mode oscillates, once a cycle is sought
  int begin_steps = first_steps;          // a period, of the search for the cycle where the scene leaves them open
  std::optional<SettledBySteps> by_fewer_steps{}; // of the search before this one
  std::optional<ResumedOrbit> resumed{};          // of the run that is gone on with, during the first search
  bool resumes = true; // the first search begins from the orbit of the run that is gone on with

  SlidingEquilibrium sliding() const { return {model.structure, model.interface, report.equilibrium}; }
  UnstableModes unstable() const
  {
    if (paced) return {std::span(&paced->mode, 1), std::span(&paced->none, 1)};
    return {followed_modes(report, scene), report.estimates};
  }
};

/// The result of a stage that did not run, with the reason.
template <class Result> Result not_run(OutcomeKind kind, const std::string& reason)
{
  Result result;
  result.outcome = {kind, reason, 0, 0};
  return result;
}

/// Whether the model has up to small_model degrees of freedom.
bool is_small(const Chain& chain);

/// Why a stage of unstable modes cannot run; empty if it can.
std::string no_unstable_mode(const Report& report);

/// Why a stage that follows a mode cannot run; empty if it can.
std::string no_mode_to_follow(const Report& report, const Scene& scene);

/// Linearises about the equilibrium, and finds the modes or takes those of the run that is gone on with.
Modes run_modes(Chain& chain);

/// Frequency responses of the scene's probes about the equilibrium.
Response run_response(Chain& chain);

/// Of every unstable mode, the followed one first; of none, the reason.
std::vector<Estimate> run_estimates(const Chain& chain);

/// The theta steps that the scene asks for, from its start.
Trajectory run_transient(const Chain& chain);

/// The whole chain on the coarse mesh, to a cycle at the steps a period with which this mesh's search begins.
CoarseStart run_coarse(Chain& fine);

/// The cycle on the model that the scene's accuracy allows. Where no unstable mode oscillates, the search starts beside
/// the equilibrium.
FittedCycle run_cycle(Chain& chain);

/// Whether the motion has settled on a cycle that is not the one found.
bool settles_on_another_cycle(const Report& report);

/// The cycle from the end of the settled motion.
FittedCycle run_cycle_from_settled(Chain& chain);

/// Whether more steps a period may change what the motion settled on: where "auto" chooses them for a small model,
/// until a motion that settled on no cycle does as it did at the steps before. The grid of time alone can make a motion
/// of impacts wander; it then diverges by the step, not by the period. Not collective.
bool steps_may_decide(const Chain& chain);

/// Notes what the motion settled on, and lets the next search begin at four times the steps a period; false where these
/// would be too many. Not collective.
bool take_finer_steps(Chain& chain);

/// Where it has converged, it answers in the settled motion's stead. Not collective.
void take_cycle_as_answer(Report& report, FittedCycle found);

/// What the motion settles on where no cycle attracts.
SettledMotion run_settled(const Chain& chain);

/// Seeks the cycle, and where none attracts the motion that is settled on. `run_stage(which, work)` returns what the
/// stage's work does, or a result that says why it was left out. Collective.
template <class RunStage> void seek_motion(Chain& chain, const RunStage& run_stage)
{
  Report& report = chain.report;
  for (bool goes_on = true; goes_on;)
  {
    FittedCycle fitted = run_stage(Stage::cycle, [&] { return run_cycle(chain); });
    report.cycle = std::move(fitted.cycle);
    report.fidelity = std::move(fitted.fidelity);
    report.settled = run_stage(Stage::settled, [&] { return run_settled(chain); });
    if (settles_on_another_cycle(report))
      take_cycle_as_answer(report, run_stage(Stage::cycle, [&] { return run_cycle_from_settled(chain); }));
    if (!steps_may_decide(chain)) break;
    goes_on = take_finer_steps(chain);
    if (!goes_on) leave_to_finer_steps(report.settled);
  }
  take_as_answer(report.settled, report.cycle.outcome);
}

/// The motions that the scene's starts lead to.
Attractors run_attractors(const Chain& chain);

/// From a state file or from rest for a given number of steps, the transient needs no mode.
bool follows_a_mode(const TransientSettings& settings);

} // namespace squeal
