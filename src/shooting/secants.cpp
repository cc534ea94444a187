#include "squeal/shooting/secants.hpp"
#include "squeal/base/cost.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

/// The rows of phase and arclength of a change.
std::array<double, 2> rows_of(const BorderedSystem& system, const BorderedVector& change)
{
  std::array<double, 2> rows{dot(system.phase, change.state), 0};
  if (system.along.get()) rows[1] = dot(system.along, change.state);
  rows[1] += system.along_period * change.period + system.along_parameter * change.parameter;
  return rows;
}

/// A preconditioned change of length 1 with its image in the scaled product, square to earlier ones, and the step that
/// causes it.
struct Direction
{
  BorderedVector change, step, image{};
};

/// The image of z, such that the scaled product with z is the plain one with the image.
BorderedVector image_of(const Flow& flow, const BorderedScales& s, const BorderedVector& z)
{
  BorderedVector image{zeros_like(z.state), z.period / (s.period * s.period),
                       z.parameter / (s.parameter * s.parameter)};
  energy_image(flow, z.state, image.state);
  check(VecScale(image.state, 1 / (s.fluctuation * s.fluctuation)));
  return image;
}

double plain_product(const BorderedVector& image, const BorderedVector& z)
{
  return dot(image.state, z.state) + image.period * z.period + image.parameter * z.parameter;
}

double norm(const BorderedSystem& system, const BorderedVector& z)
{
  return std::sqrt(scaled_product(system.problem.flow, system.scales, z, z));
}

/// Makes a direction of a step and appends it, unless less than a part `drop` of its change is new.
bool append(const BorderedSystem& system, double drop, std::vector<Direction>& directions, Direction fresh)
{
  fresh.image = image_of(system.problem.flow, system.scales, fresh.change);
  const auto length = [&] { return std::sqrt(plain_product(fresh.image, fresh.change)); };
  const double before = length();
  for (int pass = 0; pass < 2; ++pass)
    for (const Direction& old : directions)
    {
      const double along = plain_product(old.image, fresh.change);
      add(-along, old.change, fresh.change);
      add(-along, old.image, fresh.image);
      add(-along, old.step, fresh.step);
    }
  const double left = length();
  if (!(left > drop * before)) return false;
  for (BorderedVector* part : {&fresh.change, &fresh.image, &fresh.step}) scale(1 / left, *part);
  directions.push_back(std::move(fresh));
  return true;
}

/// The secant's change with the border closed.
Direction direction_of(const BorderedSystem& system, const Secant& secant)
{
  Direction direction{{copy_of(secant.change.get()), 0, 0}, copy_of(secant.step)};
  close_border(system, rows_of(system, secant.step), direction.change);
  return direction;
}

/// Moves to `step` what the direction explains of `rest`.
void take_part(const Direction& direction, BorderedVector& rest, BorderedVector& step)
{
  const double along = plain_product(direction.image, rest);
  add(-along, direction.change, rest);
  add(along, direction.step, step);
}

BorderedVector zero_like(const BorderedVector& z)
{
  return {zeros_like(z.state), 0, 0};
}

/// P^-1 [(dPhi/dx - 1) dx + d dT + dPhi/dp dp] along the period recorded last.
Secant exact_secant(const BorderedSystem& system, const Orbit& orbit, Vec parameter_column, BorderedVector step)
{
  const Owned<Vec> image = copy_of(step.state.get());
  const Vec column = image;
  system.problem.flow.apply_tangent(std::span(&column, 1));
  check(VecAXPY(image, -1, step.state));
  check(VecAXPY(image, step.period, orbit.rate));
  if (parameter_column) check(VecAXPY(image, step.parameter, parameter_column));
  return {std::move(step), preconditioned(system.problem, orbit.period, image)};
}

} // namespace

BorderedVector copy_of(const BorderedVector& z)
{
  return {copy_of(z.state.get()), z.period, z.parameter};
}

void add(double factor, const BorderedVector& x, BorderedVector& y)
{
  check(VecAXPY(y.state, factor, x.state));
  y.period += factor * x.period;
  y.parameter += factor * x.parameter;
}

void scale(double factor, BorderedVector& z)
{
  check(VecScale(z.state, factor));
  z.period *= factor;
  z.parameter *= factor;
}

double scaled_product(const Flow& flow, const BorderedScales& scales, const BorderedVector& a, const BorderedVector& b)
{
  return plain_product(image_of(flow, scales, a), b);
}

Owned<Vec> preconditioned(const OrbitProblem& problem, double period, Vec b)
{
  Owned<Vec> y = zeros_like(b);
  apply(problem.preconditioner, period, b, y);
  return y;
}

BorderedSystem system_at(const OrbitProblem& problem, const BorderedScales& scales, const Orbit& orbit)
{
  BorderedSystem system{problem, scales, zeros_like(orbit.rate)};
  energy_image(problem.flow, orbit.rate, system.phase);
  check(VecScale(system.phase, 1 / energy_norm(problem.flow, orbit.rate)));
  system.period = preconditioned(problem, orbit.period, orbit.rate);
  check(VecDot(system.phase, system.period, &system.A[0][0]));
  return system;
}

BorderedSystem system_at(const OrbitProblem& problem, const BorderedScales& scales, const Orbit& orbit,
                         Vec parameter_column, const BorderedVector& normal)
{
  BorderedSystem system = system_at(problem, scales, orbit);
  BorderedVector image = image_of(problem.flow, scales, normal);
  system.along = std::move(image.state);
  system.along_period = image.period;
  system.along_parameter = image.parameter;
  system.parameter = preconditioned(problem, orbit.period, parameter_column);
  check(VecDot(system.phase, system.parameter, &system.A[0][1]));
  check(VecDot(system.along, system.period, &system.A[1][0]));
  check(VecDot(system.along, system.parameter, &system.A[1][1]));
  system.A[1][0] -= system.along_period;
  system.A[1][1] -= system.along_parameter;
  return system;
}

void close_border(const BorderedSystem& system, const std::array<double, 2>& rows, BorderedVector& y)
{
  const auto& A = system.A;
  y.period = y.parameter = 0;
  std::array<double, 2> left = rows_of(system, y);
  for (std::size_t i = 0; i < 2; ++i) left[i] -= rows[i];
  const double determinant = A[0][0] * A[1][1] - A[0][1] * A[1][0];
  y.period = (left[0] * A[1][1] - A[0][1] * left[1]) / determinant;
  y.parameter = (A[0][0] * left[1] - left[0] * A[1][0]) / determinant;
  check(VecAXPY(y.state, -y.period, system.period));
  if (system.parameter.get()) check(VecAXPY(y.state, -y.parameter, system.parameter));
}

BorderedVector step_by_secants(const BorderedSystem& system, const std::deque<Secant>& secants, double drop,
                               BorderedVector wanted)
{
  // what is new in the change of a step that newer ones hold is no change of the Jacobian but its error
  constexpr double new_step = 1e-4;
  std::vector<Direction> directions, steps;
  BorderedVector step = zero_like(wanted);
  for (const Secant& secant : secants)
    if (append(system, new_step, steps, {copy_of(secant.step), copy_of(secant.step)}) &&
        append(system, drop, directions, direction_of(system, secant)))
      take_part(directions.back(), wanted, step);
  add(1, wanted, step);
  return step;
}

BorderedVector step_by_columns(const BorderedSystem& system, const Orbit& orbit, Vec parameter_column,
                               BorderedVector wanted, double accuracy, std::deque<Secant>& secants)
{
  constexpr int most_columns = 120;
  constexpr double rounding = 1e-12; // of a column that adds nothing
  secants.clear();
  std::vector<Direction> directions, steps;
  BorderedVector step = zero_like(wanted);
  const double whole = norm(system, wanted);
  for (int k = 0; k < most_columns && norm(system, wanted) > accuracy * whole; ++k)
  {
    // square to the earlier steps: successive residuals may be nearly parallel
    if (!append(system, rounding, steps, {copy_of(wanted), copy_of(wanted)})) break;
    Secant secant = exact_secant(system, orbit, parameter_column, copy_of(steps.back().step));
    if (!append(system, rounding, directions, direction_of(system, secant))) break;
    take_part(directions.back(), wanted, step);
    secants.push_front(std::move(secant));
  }
  add(1, wanted, step);
  return step;
}

namespace
{

/// The iteration's memory.
struct Multisecant
{
  bool exact = false;                           // steps are Newton's, whose secants are columns of the exact tangent
  std::deque<Secant> secants{};                 // newest first
  RelativeChange last_step{HUGE_VAL, HUGE_VAL}; // one step alone may change the energy by nothing by chance
};

Multisecant begin(const OrbitProblem& problem, const Orbit& start)
{
  return {problem.flow.apply_tangent && whole_tangent_is_cheap(2. * dofs_of(start.state))};
}

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

/// The relative change of an orbit by a step.
RelativeChange change_by(const OrbitProblem& problem, const Orbit& orbit, const BorderedVector& step)
{
  const Owned<Vec> fluctuation = fluctuation_of(problem, orbit);
  const double work = energy_product(problem.flow, fluctuation, step.state);
  return {std::abs(step.period) / orbit.period, 2 * std::abs(work) / (orbit.fluctuation * orbit.fluctuation)};
}

/// Whether what is left to change is below the target error, if there is one. Sets what is left.
bool meets_target(const OrbitProblem& problem, Multisecant& multisecant, const Orbit& orbit, const BorderedVector& step,
                  RelativeChange& remaining)
{
  if (!(problem.target_error > 0)) return false;
  const RelativeChange now = change_by(problem, orbit, step), before = std::exchange(multisecant.last_step, now);
  const double of_before = multisecant.exact ? 0.05 : 0.5; // exact steps leave far less than they change
  remaining = {std::max(2 * now.frequency, of_before * before.frequency), std::max(2 * now.energy, before.energy / 2)};
  return std::max(remaining.frequency, remaining.energy) <= problem.target_error;
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

RelativeChange remaining_change(const OrbitProblem& problem, const ShootingOptions& options, const Orbit& orbit)
{
  Multisecant multisecant = begin(problem, orbit);
  const Owned<Vec> defect = preconditioned(problem, orbit.period, orbit.defect);
  const RelativeChange next = change_by(problem, orbit, step_from(problem, options, multisecant, orbit, defect));
  return {2 * next.frequency, 2 * next.energy};
}

StageResult shoot_once(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log, Orbit start)
{
  if (start.residual <= problem.tolerance) return {std::move(start), StageEnding::converged};
  if (options.finish == Finish::none) return {std::move(start), StageEnding::stalled};
  Multisecant multisecant = begin(problem, start);
  StageResult best{copy_of(start), StageEnding::stalled};
  Orbit orbit = std::move(start);
  Owned<Vec> defect = preconditioned(problem, orbit.period, orbit.defect);
  // near a solution each exact step is far better than the last
  const PetscInt patience = multisecant.exact ? 8 : options.stall;
  int since_best = 0;
  while (best.orbit.residual > problem.tolerance)
  {
    BorderedVector step = step_from(problem, options, multisecant, orbit, defect);
    if (meets_target(problem, multisecant, orbit, step, best.remaining))
      return {std::move(orbit), StageEnding::converged, best.remaining};
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
    record(log, ShootingStage::multisecant, next, 2 * dofs_of(next.state) + 1);
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

StageResult prefer_fewer_rounds(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                int rounds, StageResult found)
{
  for (int prime = 2; rounds > 1; ++prime)
    for (; rounds % prime == 0; rounds /= prime)
    {
      const double period = found.orbit.period / prime;
      const OrbitProblem once{problem.flow, problem.preconditioner, copy_of(problem.equilibrium.get()),
                              period,       problem.tolerance,      problem.least_fluctuation};
      Orbit part = evaluate(once, log, found.orbit.state, period);
      if (!(part.residual < 2e-2)) continue; // the shorter period has finer steps, which move the orbit
      StageResult shorter = shoot_once(once, options, log, std::move(part));
      if (shorter.ending == StageEnding::converged) found = std::move(shorter);
    }
  return found;
}

} // namespace squeal
