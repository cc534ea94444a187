#include "squeal/shooting/multisecant.hpp"

#include "bordered_system.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// A preconditioned change (x, t) with its energy image, and the combination of secants (dx, dT) that causes it.
struct Direction
{
  Owned<Vec> change, image, step;
  double change_period = 0, period = 0;
};

/// Gram-Schmidt on the preconditioned changes, newest first; the same combinations are applied to the steps.
std::vector<Direction> orthonormalise(const OrbitProblem& problem, const std::deque<Secant>& secants, double drop,
                                      const Border& border)
{
  const double weight = border.speed * border.speed;
  std::vector<Direction> directions;
  for (const Secant& secant : secants)
  {
    Direction fresh{copy_of(secant.change), zeros_like(secant.change), copy_of(secant.step), 0, secant.period};
    double row = 0;
    check(VecDot(border.phase, secant.step, &row));
    fresh.change_period = close_border(border, fresh.change, row);
    const double before = std::hypot(energy_norm(problem.flow, fresh.change), border.speed * fresh.change_period);
    for (int pass = 0; pass < 2; ++pass)
      for (const Direction& old : directions)
      {
        double along = 0;
        check(VecDot(old.image, fresh.change, &along));
        along += weight * old.change_period * fresh.change_period;
        check(VecAXPY(fresh.change, -along, old.change));
        check(VecAXPY(fresh.step, -along, old.step));
        fresh.change_period -= along * old.change_period;
        fresh.period -= along * old.period;
      }
    const double left = std::hypot(energy_norm(problem.flow, fresh.change), border.speed * fresh.change_period);
    if (!(left > drop * before)) continue;
    check(VecScale(fresh.change, 1 / left));
    check(VecScale(fresh.step, 1 / left));
    fresh.change_period /= left;
    fresh.period /= left;
    energy_image(problem.flow, fresh.change, fresh.image);
    directions.push_back(std::move(fresh));
  }
  return directions;
}

/// P^-1 of the orbit's defect.
Owned<Vec> preconditioned_defect(const OrbitProblem& problem, const Orbit& orbit)
{
  Owned<Vec> defect = zeros_like(orbit.defect);
  apply(problem.preconditioner, orbit.period, orbit.defect, defect);
  return defect;
}

/// The clamped step (dx, dT) from the orbit; `defect`: its defect, preconditioned.
Secant step_from(const OrbitProblem& problem, const ShootingOptions& options, const Multisecant& multisecant,
                 const Orbit& orbit, Vec defect)
{
  const Border border = border_at(problem, orbit);
  const std::vector<Direction> directions = orthonormalise(problem, multisecant.secants, options.secant_drop, border);
  const Owned<Vec> rest = copy_of(defect);
  check(VecScale(rest, -1));
  double rest_period = close_border(border, rest, 0);
  Secant step{zeros_like(orbit.state), {}, 0};
  for (const Direction& direction : directions)
  {
    double along = 0;
    check(VecDot(direction.image, rest, &along));
    along += border.speed * border.speed * direction.change_period * rest_period;
    check(VecAXPY(rest, -along, direction.change));
    rest_period -= along * direction.change_period;
    check(VecAXPY(step.step, along, direction.step));
    step.period += along * direction.period;
  }
  step.period += rest_period;
  check(VecAXPY(step.step, 1, rest));
  const double length = std::max(energy_norm(problem.flow, step.step), std::abs(step.period) * border.speed);
  const double factor = std::min(1., options.clamp * orbit.fluctuation / length);
  check(VecScale(step.step, factor));
  step.period *= factor;
  return step;
}

/// Estimates what this step and all further ones change.
void note_step(const OrbitProblem& problem, Multisecant& multisecant, const Orbit& orbit, const Secant& step)
{
  const Owned<Vec> fluctuation = fluctuation_of(problem, orbit);
  const double work = energy_product(problem.flow, fluctuation, step.step);
  const RelativeChange now{std::abs(step.period) / orbit.period,
                           2 * std::abs(work) / (orbit.fluctuation * orbit.fluctuation)};
  multisecant.remaining = {std::max(2 * now.frequency, multisecant.last_step.frequency / 2),
                           std::max(2 * now.energy, multisecant.last_step.energy / 2)};
  multisecant.last_step = now;
}

/// Whether what is left to change is below the target error, if there is one.
bool meets_target(const OrbitProblem& problem, Multisecant& multisecant, const Orbit& orbit, const Secant& step)
{
  if (!(multisecant.target_error > 0)) return false;
  note_step(problem, multisecant, orbit, step);
  return std::max(multisecant.remaining.frequency, multisecant.remaining.energy) <= multisecant.target_error;
}

/// Keeps a step with what it did to the preconditioned defect: `defect` becomes that of `next`.
void keep_secant(const OrbitProblem& problem, const ShootingOptions& options, Multisecant& multisecant, Secant step,
                 const Orbit& next, Owned<Vec>& defect)
{
  step.change = preconditioned_defect(problem, next);
  std::swap(step.change, defect);
  check(VecAYPX(step.change, -1, defect));
  multisecant.secants.push_front(std::move(step));
  if (static_cast<PetscInt>(multisecant.secants.size()) > options.secants) multisecant.secants.pop_back();
}

} // namespace

void estimate_remaining_change(const OrbitProblem& problem, const ShootingOptions& options, Multisecant& multisecant,
                               const Orbit& orbit)
{
  const Owned<Vec> defect = preconditioned_defect(problem, orbit);
  note_step(problem, multisecant, orbit, step_from(problem, options, multisecant, orbit, defect));
}

StageResult shoot_by_multisecant(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                 Multisecant& multisecant, const Orbit& start)
{
  StageResult best{copy_of(start), StageEnding::stalled};
  Orbit orbit = copy_of(start);
  Owned<Vec> defect = preconditioned_defect(problem, orbit);
  int since_best = 0;
  while (best.orbit.residual > problem.tolerance)
  {
    Secant step = step_from(problem, options, multisecant, orbit, defect);
    if (meets_target(problem, multisecant, orbit, step)) return {std::move(orbit), StageEnding::converged};
    if (log.convergence.periods >= options.max_periods || since_best >= options.stall) return best;
    if (!admissible_period(problem, orbit.period + step.period))
    {
      best.ending = StageEnding::period_left_range;
      return best;
    }
    const Owned<Vec> moved = copy_of(orbit.state);
    check(VecAXPY(moved, 1, step.step));
    Orbit next = evaluate(problem, log, moved, orbit.period + step.period);
    ++log.convergence.iterations;
    record_full(log, ShootingStage::multisecant, next);
    if (collapsing(problem, next) || !std::isfinite(next.residual))
    {
      best.ending = StageEnding::collapsed;
      return best;
    }
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
