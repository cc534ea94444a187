#include "squeal/shooting/secants.hpp"

#include <cmath>

namespace squeal
{

namespace
{

/// The rows of phase and arclength of a change.
std::array<double, 2> rows_of(const BorderedSystem& system, const BorderedVector& change)
{
  std::array<double, 2> rows{};
  check(VecDot(system.phase, change.state, &rows[0]));
  if (system.along.get()) check(VecDot(system.along, change.state, &rows[1]));
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
  double product = 0;
  check(VecDot(image.state, z.state, &product));
  return product + image.period * z.period + image.parameter * z.parameter;
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

} // namespace squeal
