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

/// Whether the cycle is to be sought once more, at four times the steps a period: where "auto" chooses them for a small
/// model, until a motion that settled on no cycle does as it did at the steps before. The grid of time alone can make a
/// motion of impacts wander; it then diverges by the step, not by the period. Notes the motion and the steps. A motion
/// that the finest steps still change becomes undecided. Not collective.
bool goes_on_with_finer_steps(Chain& chain);

/// Where it has converged, it answers in the settled motion's stead. Not collective.
void take_cycle_as_answer(Report& report, FittedCycle found);

/// What the motion settles on where no cycle attracts.
SettledMotion run_settled(const Chain& chain);

/// The motions that the scene's starts lead to.
Attractors run_attractors(const Chain& chain);

/// From a state file or from rest for a given number of steps, the transient needs no mode.
bool follows_a_mode(const TransientSettings& settings);

} // namespace squeal
