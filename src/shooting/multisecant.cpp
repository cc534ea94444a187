#include "squeal/shooting/multisecant.hpp"

#include "free_periods.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// The clamped step (dx, dT) from the orbit; `defect`: its defect, preconditioned.
BorderedVector step_from(const OrbitProblem& problem, const ShootingOptions& options, Multisecant& multisecant,
                         const Orbit& orbit, Vec defect)
{
  const double speed = energy_norm(problem.flow, orbit.rate);
  const BorderedScales scales{1, 1 / speed, 1};
  const BorderedSystem system = system_at(problem, scales, orbit);
  BorderedVector wanted{copy_of(defect), 0, 0};
  close_border(system, {0, 0}, wanted);
  scale(-1, wanted);
  if (multisecant.exact) problem.flow.record_period(orbit.period, orbit.state, {});
  constexpr double solved = 1e-8; // of the linear system
  BorderedVector step = multisecant.exact
                            ? step_by_columns(system, orbit, nullptr, std::move(wanted), solved, multisecant.secants)
                            : step_by_secants(system, multisecant.secants, options.secant_drop, std::move(wanted));
  const double length = std::max(energy_norm(problem.flow, step.state), std::abs(step.period) * speed);
  scale(std::min(1., options.clamp * orbit.fluctuation / length), step);
  return step;
}

/// Estimates what this step and all further ones change.
void note_step(const OrbitProblem& problem, Multisecant& multisecant, const Orbit& orbit, const BorderedVector& step)
{
  const Owned<Vec> fluctuation = fluctuation_of(problem, orbit);
  const double work = energy_product(problem.flow, fluctuation, step.state);
  const RelativeChange now{std::abs(step.period) / orbit.period,
                           2 * std::abs(work) / (orbit.fluctuation * orbit.fluctuation)};
  multisecant.remaining = {std::max(2 * now.frequency, multisecant.last_step.frequency / 2),
                           std::max(2 * now.energy, multisecant.last_step.energy / 2)};
  multisecant.last_step = now;
}

/// Whether what is left to change is below the target error, if there is one.
bool meets_target(const OrbitProblem& problem, Multisecant& multisecant, const Orbit& orbit, const BorderedVector& step)
{
  if (!(multisecant.target_error > 0)) return false;
  note_step(problem, multisecant, orbit, step);
  return std::max(multisecant.remaining.frequency, multisecant.remaining.energy) <= multisecant.target_error;
}

/// Keeps a step with what it did to the preconditioned defect: `defect` becomes that of `next`.
void keep_secant(const OrbitProblem& problem, const ShootingOptions& options, Multisecant& multisecant,
                 BorderedVector step, const Orbit& next, Owned<Vec>& defect)
{
  Secant secant{std::move(step), preconditioned(problem, next.period, next.defect)};
  std::swap(secant.change, defect);
  check(VecAYPX(secant.change, -1, defect));
  multisecant.secants.push_front(std::move(secant));
  if (static_cast<PetscInt>(multisecant.secants.size()) > options.secants) multisecant.secants.pop_back();
}

} // namespace

void estimate_remaining_change(const OrbitProblem& problem, const ShootingOptions& options, Multisecant& multisecant,
                               const Orbit& orbit)
{
  const Owned<Vec> defect = preconditioned(problem, orbit.period, orbit.defect);
  note_step(problem, multisecant, orbit, step_from(problem, options, multisecant, orbit, defect));
}

StageResult shoot_by_multisecant(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                 Multisecant& multisecant, const Orbit& start)
{
  StageResult best{copy_of(start), StageEnding::stalled};
  Orbit orbit = copy_of(start);
  Owned<Vec> defect = preconditioned(problem, orbit.period, orbit.defect);
  // near a solution each exact step is far better than the last
  const PetscInt patience = multisecant.exact ? 8 : options.stall;
  int since_best = 0;
  while (best.orbit.residual > problem.tolerance)
  {
    BorderedVector step = step_from(problem, options, multisecant, orbit, defect);
    if (meets_target(problem, multisecant, orbit, step)) return {std::move(orbit), StageEnding::converged};
    if (log.convergence.periods >= options.max_periods || since_best >= patience) return best;
    // whole steps may go to and fro across a kink of the flow, where an event of contact passes from one step to
    // another
    if (multisecant.exact) scale(1. / (1 + std::min(since_best, 2)), step);
    if (!admissible_period(problem, orbit.period + step.period))
    {
      best.ending = StageEnding::period_left_range;
      return best;
    }
    const Owned<Vec> moved = copy_of(orbit.state);
    check(VecAXPY(moved, 1, step.state));
    Orbit next = evaluate(problem, log, moved, orbit.period + step.period);
    ++log.convergence.iterations;
    record_full(log, ShootingStage::multisecant, next);
    const bool slips = slips_one_way(problem, next);
    if (slips) next = integrate_free_periods(problem, log, next.state, next.period, {1, 0, options.free_periods});
    if (collapsing(problem, next) || !std::isfinite(next.residual))
    {
      best.ending = StageEnding::collapsed;
      return best;
    }
    if (slips)
      defect = preconditioned(problem, next.period, next.defect);
    else
      keep_secant(problem, options, multisecant, std::move(step), next, defect);
    ++since_best;
    if (next.residual < best.orbit.residual)
    {
      best.orbit = copy_of(next);
      since_best = 0;
    }
    orbit = std::move(next);
  }
  best.ending = StageEnding::converged;
  return best;
}

} // namespace squeal
