#pragma once
/// Full-space solution by secants (src/README.md, section 6.7; Anderson 1965, Eyert 1996) about the preconditioner: one
/// period a step, no difference columns.
///
/// Caveat: no globalisation. The step is clamped and the iteration guarded, and it ends without progress.
#include "squeal/shooting/options.hpp"
#include "squeal/shooting/secants.hpp"

namespace squeal
{

/// Relative changes of an orbit.
struct RelativeChange
{
  double frequency = 0, energy = 0;
};

/// The iteration's memory; it serves the next solution at nearly the same flow as well.
struct Multisecant
{
  bool exact = false;           // steps are Newton's, whose secants are columns of the exact tangent
  std::deque<Secant> secants{}; // newest first
  double target_error = 0;      // above 0: converged as soon as `remaining` is at most this
  RelativeChange last_step{};   // of the latest step estimated
  RelativeChange remaining{};   // estimate of what all further steps would change
};

/// Sets `last_step` to what the next step from the orbit would change. `remaining` is twice that, or half of the step
/// before if that is more, since the signs of the steps alternate. Collective.
void estimate_remaining_change(const OrbitProblem& problem, const ShootingOptions& options, Multisecant& multisecant,
                               const Orbit& orbit);

/// Iterates from `start` until the residual meets the problem's tolerance, or the remaining change the target error.
/// The ending says whether it did, stalled or collapsed to the equilibrium. Collective. Error: as of the flow.
StageResult shoot_by_multisecant(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                 Multisecant& multisecant, const Orbit& start);

} // namespace squeal
