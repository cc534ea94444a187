#include "corrector.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr int most_iterations = 12, most_columns = 120;
constexpr double good_reduction = 0.3; // of the residual by a step: a worse one calls for a new Jacobian

// The map of a period jumps where an event of contact meets the grid of time: an orbit there closes on neither side,
// and exact steps alternate between both. The same orbit begun a part of a step later has the event elsewhere.
constexpr double no_reduction = 0.9; // of the residual by an exact step; those of a jump leave 0.95 and more
constexpr int steps_without_reduction = 2, most_moves = 3;
constexpr double moved_by = 0.3; // of a step of the grid: three moves try four places of the event in it

// Where none of them helps, the better side of the jump is taken, up to so many times the tolerance: its residual is
// reported.
constexpr double beside_jump = 10;

Owned<Vec> preconditioned(const BranchCorrector& corrector, double period, Vec b)
{
  Owned<Vec> y = zeros_like(b);
  if (corrector.family.preconditioner)
    corrector.family.preconditioner(period, b, y);
  else
    check(VecAXPY(y, -1, b));
  return y;
}

/// The rows of phase and arclength, and the columns of T and p, preconditioned, at an orbit.
struct BranchBorder
{
  Owned<Vec> phase, along;              // energy images of the unit flow, and of the normal's state over its scale
  double along_period, along_parameter; // of the arclength row
  Owned<Vec> period, parameter;         // P^-1 d, P^-1 dPhi/dp
  double A[2][2];                       // of (dT, dp), the state eliminated
};

BranchBorder border_at(const BranchCorrector& corrector, const Orbit& orbit, const BranchVector& normal)
{
  const Flow& flow = corrector.family.flow;
  const BranchScales& scales = corrector.scales;
  BranchBorder border{zeros_like(orbit.rate),
                      zeros_like(orbit.rate),
                      normal.period / (scales.period * scales.period),
                      normal.parameter / (scales.parameter * scales.parameter),
                      preconditioned(corrector, orbit.period, orbit.rate),
                      preconditioned(corrector, orbit.period, corrector.parameter_column),
                      {}};
  energy_image(flow, orbit.rate, border.phase);
  check(VecScale(border.phase, 1 / energy_norm(flow, orbit.rate)));
  energy_image(flow, normal.state, border.along);
  check(VecScale(border.along, 1 / (scales.fluctuation * scales.fluctuation)));
  check(VecDot(border.phase, border.period, &border.A[0][0]));
  check(VecDot(border.phase, border.parameter, &border.A[0][1]));
  check(VecDot(border.along, border.period, &border.A[1][0]));
  check(VecDot(border.along, border.parameter, &border.A[1][1]));
  border.A[1][0] -= border.along_period;
  border.A[1][1] -= border.along_parameter;
  return border;
}

/// The rows of phase and arclength of a change.
std::array<double, 2> rows_of(const BranchBorder& border, const BranchVector& change)
{
  std::array<double, 2> rows{};
  check(VecDot(border.phase, change.state, &rows[0]));
  check(VecDot(border.along, change.state, &rows[1]));
  rows[1] += border.along_period * change.period + border.along_parameter * change.parameter;
  return rows;
}

/// The solution of the bordered system with P for dPhi/dx - 1, whose right sides are P y.state and the rows.
void close(const BranchBorder& border, const std::array<double, 2>& rows, BranchVector& y)
{
  y.period = y.parameter = 0;
  std::array<double, 2> left = rows_of(border, y);
  for (std::size_t i = 0; i < 2; ++i) left[i] -= rows[i];
  const double determinant = border.A[0][0] * border.A[1][1] - border.A[0][1] * border.A[1][0];
  y.period = (left[0] * border.A[1][1] - border.A[0][1] * left[1]) / determinant;
  y.parameter = (border.A[0][0] * left[1] - left[0] * border.A[1][0]) / determinant;
  check(VecAXPY(y.state, -y.period, border.period));
  check(VecAXPY(y.state, -y.parameter, border.parameter));
}

/// A preconditioned change of length 1 with its image in the scaled product, square to earlier ones, and the step that
/// causes it.
struct Direction
{
  BranchVector change, step, image{};
};

/// The image of z, such that the scaled product with z is the plain one with the image.
BranchVector image_of(const BranchCorrector& corrector, const BranchVector& z)
{
  const BranchScales& s = corrector.scales;
  BranchVector image{zeros_like(z.state), z.period / (s.period * s.period), z.parameter / (s.parameter * s.parameter)};
  energy_image(corrector.family.flow, z.state, image.state);
  check(VecScale(image.state, 1 / (s.fluctuation * s.fluctuation)));
  return image;
}

double plain_product(const BranchVector& image, const BranchVector& z)
{
  double product = 0;
  check(VecDot(image.state, z.state, &product));
  return product + image.period * z.period + image.parameter * z.parameter;
}

/// Makes a direction of a step and appends it, unless less than a part `drop` of its change is new.
bool append(const BranchCorrector& corrector, double drop, std::vector<Direction>& directions, Direction fresh)
{
  const double before = std::sqrt(scaled_product(corrector, fresh.change, fresh.change));
  for (int pass = 0; pass < 2; ++pass)
    for (const Direction& old : directions)
    {
      const double along = plain_product(old.image, fresh.change);
      add(-along, old.change, fresh.change);
      add(-along, old.step, fresh.step);
    }
  const double left = std::sqrt(scaled_product(corrector, fresh.change, fresh.change));
  if (!(left > drop * before)) return false;
  scale(1 / left, fresh.change);
  scale(1 / left, fresh.step);
  fresh.image = image_of(corrector, fresh.change);
  directions.push_back(std::move(fresh));
  return true;
}

/// The secant's change with the border closed.
Direction direction_of(const BranchBorder& border, const BranchSecant& secant)
{
  Direction direction{{copy_of(secant.change.get()), 0, 0}, copy_of(secant.step)};
  close(border, rows_of(border, secant.step), direction.change);
  return direction;
}

/// Moves to `step` what the direction explains of `rest`.
void take_part(const Direction& direction, BranchVector& rest, BranchVector& step)
{
  const double along = plain_product(direction.image, rest);
  add(-along, direction.change, rest);
  add(along, direction.step, step);
}

BranchVector zero_like(const BranchVector& z)
{
  return {zeros_like(z.state), 0, 0};
}

/// The step whose preconditioned change is `wanted`, by the secants at hand; P where they say nothing. A secant whose
/// step the newer ones hold is left out. What is new in its change is no change of the Jacobian but its error.
BranchVector step_by_secants(const BranchCorrector& corrector, const BranchBorder& border, BranchVector wanted)
{
  constexpr double new_step = 1e-4; // smallest part of a step that must be new
  std::vector<Direction> directions, steps;
  BranchVector step = zero_like(wanted);
  for (const BranchSecant& secant : corrector.secants)
    if (append(corrector, new_step, steps, {copy_of(secant.step), copy_of(secant.step)}) &&
        append(corrector, corrector.options.secant_drop, directions, direction_of(border, secant)))
      take_part(directions.back(), wanted, step);
  add(1, wanted, step);
  return step;
}

void keep(BranchCorrector& corrector, BranchSecant secant)
{
  corrector.secants.push_front(std::move(secant));
  // GCR's own pairs must all stay until the system that they solve is solved
  if (corrector.secants.size() > static_cast<std::size_t>(std::max<PetscInt>(corrector.options.secants, most_columns)))
    corrector.secants.pop_back();
}

/// P^-1 [(dPhi/dx - 1) dx + d dT + dPhi/dp dp] along the period recorded last.
BranchSecant exact_secant(BranchCorrector& corrector, const Orbit& orbit, BranchVector step)
{
  const Owned<Vec> image = copy_of(step.state.get());
  const Vec column = image;
  corrector.family.flow.apply_tangent(std::span(&column, 1));
  ++corrector.columns;
  check(VecAXPY(image, -1, step.state));
  check(VecAXPY(image, step.period, orbit.rate));
  check(VecAXPY(image, step.parameter, corrector.parameter_column));
  Owned<Vec> change = preconditioned(corrector, orbit.period, image);
  return {std::move(step), std::move(change)};
}

/// Replaces the secants by exact ones while it solves for the step whose preconditioned change is `wanted`, by GCR to a
/// part `accuracy` of it.
BranchVector step_by_columns(BranchCorrector& corrector, const Orbit& orbit, const BranchBorder& border,
                             BranchVector wanted, double accuracy)
{
  constexpr double rounding = 1e-12; // of a column that adds nothing
  corrector.secants.clear();
  std::vector<Direction> directions, steps;
  BranchVector step = zero_like(wanted);
  const double whole = std::sqrt(scaled_product(corrector, wanted, wanted));
  for (int k = 0; k < most_columns && std::sqrt(scaled_product(corrector, wanted, wanted)) > accuracy * whole; ++k)
  {
    // square to the earlier steps: successive residuals may be nearly parallel
    if (!append(corrector, rounding, steps, {copy_of(wanted), copy_of(wanted)})) break;
    BranchSecant secant = exact_secant(corrector, orbit, copy_of(steps.back().step));
    if (!append(corrector, rounding, directions, direction_of(border, secant))) break;
    take_part(directions.back(), wanted, step);
    keep(corrector, std::move(secant));
  }
  add(1, wanted, step);
  return step;
}

/// Records the period of the orbit, and forms the column of p there.
void form_jacobian(BranchCorrector& corrector, const Orbit& orbit)
{
  if (!corrector.parameter_column.get()) corrector.parameter_column = zeros_like(orbit.state);
  corrector.family.parameter_column(orbit.period, orbit.state, corrector.parameter_column);
  corrector.family.flow.record_period(orbit.period, orbit.state, {});
  if (corrector.family.renew_preconditioner) corrector.family.renew_preconditioner(orbit.period, orbit.state);
  corrector.log.convergence.periods += 2;
}

/// Whether an iterate may lead to an orbit of this branch.
bool makes_progress(const BranchCorrector& corrector, const Orbit& orbit, double first_residual)
{
  return std::isfinite(orbit.residual) && orbit.residual < 10 * std::max(first_residual, 1e-3) &&
         orbit.fluctuation < 4 * corrector.scales.fluctuation && orbit.fluctuation > corrector.scales.fluctuation / 20;
}

} // namespace

BranchVector copy_of(const BranchVector& z)
{
  return {copy_of(z.state.get()), z.period, z.parameter};
}

void add(double factor, const BranchVector& x, BranchVector& y)
{
  check(VecAXPY(y.state, factor, x.state));
  y.period += factor * x.period;
  y.parameter += factor * x.parameter;
}

void scale(double factor, BranchVector& z)
{
  check(VecScale(z.state, factor));
  z.period *= factor;
  z.parameter *= factor;
}

double scaled_product(const BranchCorrector& corrector, const BranchVector& a, const BranchVector& b)
{
  return plain_product(image_of(corrector, a), b);
}

OrbitProblem problem_of(const BranchCorrector& corrector)
{
  return {corrector.family.flow, corrector.family.preconditioner, copy_of(corrector.rest.get()),
          corrector.period,      corrector.settings.tolerance,    0};
}

BranchVector vector_of(const CorrectedOrbit& corrected)
{
  return {copy_of(corrected.orbit.state.get()), corrected.orbit.period, corrected.parameter};
}

std::optional<CorrectedOrbit> correct(BranchCorrector& corrector, const BranchVector& predicted,
                                      const BranchVector& normal)
{
  const OrbitProblem problem = problem_of(corrector);
  const auto evaluate_at = [&](const BranchVector& z)
  {
    corrector.family.set_parameter(z.parameter);
    return evaluate(problem, corrector.log, z.state, z.period);
  };
  BranchVector z = copy_of(predicted);
  Orbit orbit = evaluate_at(z);
  const double first_residual = orbit.residual;
  bool renew = corrector.secants.empty();
  int without_reduction = 0, moves = 0, corrections = 0;
  std::optional<CorrectedOrbit> best; // beside a jump
  for (int iteration = 0; iteration <= most_iterations; ++iteration)
  {
    if (!makes_progress(corrector, orbit, first_residual)) break;
    record_full(corrector.log, ShootingStage::multisecant, orbit);
    if (orbit.residual <= problem.tolerance) return CorrectedOrbit{std::move(orbit), z.parameter, corrections};
    if (without_reduction > 0 && !(best && best->orbit.residual <= orbit.residual))
      best = CorrectedOrbit{copy_of(orbit), z.parameter, corrections};
    if (without_reduction == steps_without_reduction && corrector.settings.steps > 0)
    {
      if (moves == most_moves) break;
      check(VecAXPY(z.state, moved_by * z.period / corrector.settings.steps, orbit.rate));
      orbit = evaluate_at(z);
      without_reduction = 0;
      renew = true;
      ++moves;
      iteration = -1; // as many again
      continue;
    }
    if (renew) form_jacobian(corrector, orbit);
    const BranchBorder border = border_at(corrector, orbit, normal);
    Owned<Vec> defect = preconditioned(corrector, orbit.period, orbit.defect);
    BranchVector wanted{copy_of(defect.get()), 0, 0};
    close(border, {0, 0}, wanted);
    scale(-1, wanted);
    BranchVector step = renew ? step_by_columns(corrector, orbit, border, std::move(wanted), 0.03)
                              : step_by_secants(corrector, border, std::move(wanted));
    const double length = std::sqrt(scaled_product(corrector, step, step));
    const bool clamped = length > corrector.options.clamp;
    if (clamped) scale(corrector.options.clamp / length, step);
    add(1, step, z);
    ++corrections;
    if (!admissible_period(problem, z.period)) break;
    Orbit next = evaluate_at(z);
    const bool exact = renew && !clamped;
    without_reduction = exact && next.residual > no_reduction * orbit.residual ? without_reduction + 1 : 0;
    renew = next.residual > good_reduction * orbit.residual;
    Owned<Vec> change = preconditioned(corrector, next.period, next.defect);
    check(VecAXPY(change, -1, defect));
    keep(corrector, {std::move(step), std::move(change)});
    orbit = std::move(next);
  }
  if (moves == most_moves && best && best->orbit.residual <= beside_jump * problem.tolerance) return best;
  return {};
}

BranchVector tangent_at(BranchCorrector& corrector, const CorrectedOrbit& corrected, const BranchVector& about)
{
  const Orbit& orbit = corrected.orbit;
  corrector.family.set_parameter(corrected.parameter);
  form_jacobian(corrector, orbit);
  const BranchBorder border = border_at(corrector, orbit, about);
  BranchVector wanted{zeros_like(orbit.state), 0, 0};
  close(border, {0, 1}, wanted);
  BranchVector tangent = step_by_columns(corrector, orbit, border, std::move(wanted), 1e-3);
  scale(1 / std::sqrt(scaled_product(corrector, tangent, tangent)), tangent);
  return tangent;
}

} // namespace squeal
