#pragma once
/// Full-space solution by secants (src/README.md, section 6.7; Anderson 1965, Eyert 1996) about the preconditioner: one
/// period a step, no difference columns. States are bordered by T and by the phase row <f, dx>; B is the bordered P, G
/// = B^-1 (F, 0) the preconditioned defect. With the last steps X and their changes of G, Y = Q R,
///     dx = -X R^-1 Q'G - (1 - Q Q') G.
/// Q is orthogonal in the energy norm of G, not of F. In F, motions that the next period damps out would be larger than
/// the slow ones that are sought.
///
/// Caveat: no globalisation. The step is clamped and the iteration guarded, and it ends without progress.
#include "squeal/shooting/options.hpp"
#include "squeal/shooting/orbit.hpp"

#include <deque>

namespace squeal
{

/// A step of the iteration and what it did to the preconditioned defect.
struct Secant
{
  Owned<Vec> step, change; // dx; P^-1 dF
  double period = 0;       // [s] dT
};

/// Relative changes of an orbit.
struct RelativeChange
{
  double frequency = 0, energy = 0;
};

/// The iteration's memory; it serves the next solution at nearly the same flow as well.
struct Multisecant
{
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
