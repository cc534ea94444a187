/// Full-space finish by secants (Anderson 1965; Eyert 1996) about the preconditioner: one period a step, no difference
/// columns. States are bordered by T and by the phase row <f, dx>; B is the bordered P, G = B^-1 (F, 0) the
/// preconditioned defect. With the last steps X and their changes of G, Y = Q R,
///     dx = -X R^-1 Q'G - (1 - Q Q') G.
/// Q is orthogonal in the energy norm of G, not of F: there the slow motions weigh what they are worth, and what the
/// next period forgets anyhow does not drown them.
/// Caveat: no globalisation. It is clamped and guarded, and gives up rather than wander.
#include "squeal/shooting/shooting.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// A preconditioned change (x, t) with its energy image, and the combination of secants (dx, dT) it answers to.
struct Direction
{
  Owned<Vec> change, image, step;
  double change_period = 0, period = 0;
};

/// Newest first: Gram-Schmidt on the preconditioned changes, the same combinations applied to the steps.
std::vector<Direction> orthonormalise(const Shooting& shooting, const Border& border)
{
  const double weight = border.speed * border.speed;
  std::vector<Direction> directions;
  for (const Secant& secant : shooting.secants)
  {
    Direction fresh{copy_of(secant.change), zeros_like(secant.change), copy_of(secant.step), 0, secant.period};
    double row = 0;
    check(VecDot(border.phase, secant.step, &row));
    fresh.change_period = close_border(border, fresh.change, row);
    const double before = std::hypot(energy_norm(shooting.flow, fresh.change), border.speed * fresh.change_period);
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
    const double left = std::hypot(energy_norm(shooting.flow, fresh.change), border.speed * fresh.change_period);
    if (!(left > shooting.options.drop * before)) continue;
    check(VecScale(fresh.change, 1 / left));
    check(VecScale(fresh.step, 1 / left));
    fresh.change_period /= left;
    fresh.period /= left;
    energy_image(shooting.flow, fresh.change, fresh.image);
    directions.push_back(std::move(fresh));
  }
  return directions;
}

/// The step and its dT from the orbit's defect, preconditioned.
Secant step_from(const Shooting& shooting, const Orbit& orbit, Vec defect)
{
  const Border border = border_at(shooting, orbit);
  const std::vector<Direction> directions = orthonormalise(shooting, border);
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
  const double length = std::max(energy_norm(shooting.flow, step.step), std::abs(step.period) * border.speed);
  const double factor = std::min(1., shooting.options.clamp * orbit.fluctuation / length);
  check(VecScale(step.step, factor));
  step.period *= factor;
  return step;
}

} // namespace

Secant next_step(const Shooting& shooting, const Orbit& orbit)
{
  const Owned<Vec> defect = zeros_like(orbit.defect);
  apply(shooting.preconditioner, orbit.period, orbit.defect, defect);
  return step_from(shooting, orbit, defect);
}

void judge(Shooting& shooting, const Orbit& orbit, const Secant& step)
{
  const Owned<Vec> fluctuation = copy_of(orbit.state);
  check(VecAXPY(fluctuation, -1, shooting.equilibrium));
  const double work = energy_product(shooting.flow, fluctuation, step.step);
  const Moves now{std::abs(step.period) / orbit.period, 2 * std::abs(work) / (orbit.fluctuation * orbit.fluctuation)};
  shooting.to_come = {std::max(2 * now.frequency, shooting.last.frequency / 2),
                      std::max(2 * now.energy, shooting.last.energy / 2)};
  shooting.last = now;
}

Finish shoot_multisecant(Shooting& shooting, const Orbit& start)
{
  Finish finish{copy_of(start), Ending::stalled};
  Orbit orbit = copy_of(start);
  Owned<Vec> defect = zeros_like(orbit.defect); // preconditioned
  apply(shooting.preconditioner, orbit.period, orbit.defect, defect);
  int since_best = 0;
  while (finish.orbit.residual > shooting.tolerance)
  {
    Secant step = step_from(shooting, orbit, defect);
    if (shooting.wish > 0) judge(shooting, orbit, step);
    if (shooting.wish > 0 && std::max(shooting.to_come.frequency, shooting.to_come.energy) <= shooting.wish)
      return {std::move(orbit), Ending::converged};
    if (shooting.periods >= shooting.options.max_periods || since_best >= shooting.options.stall) return finish;
    if (!admissible_period(shooting, orbit.period + step.period))
    {
      finish.ending = Ending::not_periodic;
      return finish;
    }
    const Owned<Vec> moved = copy_of(orbit.state);
    check(VecAXPY(moved, 1, step.step));
    Orbit next = evaluate(shooting, moved, orbit.period + step.period);
    ++shooting.iterations;
    record(shooting, "multisecant", full_unknowns(next), std::nan(""), next);
    if (vanishing(shooting, next) || !std::isfinite(next.residual))
    {
      finish.ending = Ending::vanished;
      return finish;
    }
    step.change = zeros_like(defect);
    apply(shooting.preconditioner, next.period, next.defect, step.change);
    std::swap(step.change, defect);
    check(VecAYPX(step.change, -1, defect));
    shooting.secants.push_front(std::move(step));
    if (static_cast<PetscInt>(shooting.secants.size()) > shooting.options.secants) shooting.secants.pop_back();
    ++since_best;
    if (next.residual < finish.orbit.residual)
    {
      finish.orbit = copy_of(next);
      since_best = 0;
    }
    orbit = std::move(next);
  }
  finish.ending = Ending::converged;
  return finish;
}

} // namespace squeal
