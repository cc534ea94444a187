/// Full-space finish by secants (Anderson 1965; Eyert 1996) about the real-mode preconditioner: one period a step, no
/// difference columns. With the last steps X and residual changes Y = Q R,
///     dx = X R^-1 Q'b + P^-1 (b - Q Q'b),   b = -(F, 0),
/// where states are bordered by T (in X) and by the phase row <f, dx> (in Y), and P^-1 solves its border exactly.
/// Caveat: no globalisation. It is clamped and guarded, and gives up rather than wander.
#include "squeal/analysis/shooting.hpp"

#include <algorithm>
#include <cmath>
#include <deque>

namespace squeal
{

namespace
{

struct Secant
{
  Owned<Vec> step, change; // dx and dF
  double period = 0;       // dT
};

/// A column of Q with its energy image, and the combination of secants it is.
struct Direction
{
  Owned<Vec> change, image, step;
  double border = 0, period = 0;
};

/// Newest first: Gram-Schmidt on the changes, the same combinations applied to the steps, so that X R^-1 is at hand.
std::vector<Direction> orthonormalise(const Shooting& shooting, const std::deque<Secant>& secants, Vec phase)
{
  std::vector<Direction> directions;
  for (const Secant& secant : secants)
  {
    Direction fresh{copy_of(secant.change), zeros_like(secant.change), copy_of(secant.step), 0, secant.period};
    check(VecDot(phase, secant.step, &fresh.border));
    const double before = energy_norm(shooting.flow, fresh.change);
    for (int pass = 0; pass < 2; ++pass)
      for (const Direction& old : directions)
      {
        double along = 0;
        check(VecDot(old.image, fresh.change, &along));
        along += old.border * fresh.border;
        check(VecAXPY(fresh.change, -along, old.change));
        check(VecAXPY(fresh.step, -along, old.step));
        fresh.border -= along * old.border;
        fresh.period -= along * old.period;
      }
    const double left = std::hypot(energy_norm(shooting.flow, fresh.change), fresh.border);
    if (!(left > shooting.options.drop * before)) continue;
    check(VecScale(fresh.change, 1 / left));
    check(VecScale(fresh.step, 1 / left));
    fresh.border /= left;
    fresh.period /= left;
    energy_image(shooting.flow, fresh.change, fresh.image);
    directions.push_back(std::move(fresh));
  }
  return directions;
}

/// The step and its dT from the orbit's defect.
Secant next_step(const Shooting& shooting, const Orbit& orbit, const std::deque<Secant>& secants)
{
  const Owned<Vec> phase = zeros_like(orbit.rate);
  energy_image(shooting.flow, orbit.rate, phase);
  check(VecScale(phase, 1 / energy_norm(shooting.flow, orbit.rate)));
  const std::vector<Direction> directions = orthonormalise(shooting, secants, phase);
  const Owned<Vec> rest = copy_of(orbit.defect);
  check(VecScale(rest, -1));
  double border = 0;
  Secant step{zeros_like(orbit.state), {}, 0};
  for (const Direction& direction : directions)
  {
    double along = 0;
    check(VecDot(direction.image, rest, &along));
    along += direction.border * border;
    check(VecAXPY(rest, -along, direction.change));
    border -= along * direction.border;
    check(VecAXPY(step.step, along, direction.step));
    step.period += along * direction.period;
  }
  const Owned<Vec> outside = zeros_like(rest);
  step.period += solve_bordered(shooting, orbit, phase, rest, border, outside);
  check(VecAXPY(step.step, 1, outside));
  const double speed = energy_norm(shooting.flow, orbit.rate);
  const double length = std::max(energy_norm(shooting.flow, step.step), std::abs(step.period) * speed);
  const double factor = std::min(1., shooting.options.clamp * orbit.fluctuation / length);
  check(VecScale(step.step, factor));
  step.period *= factor;
  return step;
}

} // namespace

Finish shoot_multisecant(Shooting& shooting, const Orbit& start)
{
  Finish finish{copy_of(start), Ending::stalled};
  Orbit orbit = copy_of(start);
  std::deque<Secant> secants; // newest first
  int since_best = 0;
  while (finish.orbit.residual > shooting.tolerance)
  {
    if (shooting.periods >= shooting.options.max_periods || since_best >= shooting.options.stall) return finish;
    Secant step = next_step(shooting, orbit, secants);
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
    step.change = copy_of(next.defect);
    check(VecAXPY(step.change, -1, orbit.defect));
    secants.push_front(std::move(step));
    if (static_cast<PetscInt>(secants.size()) > shooting.options.secants) secants.pop_back();
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
