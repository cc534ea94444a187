#include "corrector.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr int most_iterations = 12, most_secants = 120;
constexpr double good_reduction = 0.3; // of the residual by a step: a worse one calls for a new Jacobian

// The map of a period jumps where an event of contact meets the grid of time: an orbit there closes on neither side,
// and steps alternate between both. The same orbit begun a part of a step later has the event elsewhere.
constexpr double progress = 0.9; // of the least residual so far
constexpr int steps_without_progress = 4, most_moves = 3;
constexpr double moved_by = 0.3; // of a step of the grid: three moves try four places of the event in it

// Where none of them helps, the better side of the jump is taken, up to so many times the tolerance: its residual is
// reported.
constexpr double beside_jump = 10;

void keep(BranchCorrector& corrector, Secant secant)
{
  corrector.secants.push_front(std::move(secant));
  if (corrector.secants.size() > static_cast<std::size_t>(std::max<PetscInt>(corrector.options.secants, most_secants)))
    corrector.secants.pop_back();
}

/// The step whose preconditioned change is `wanted`, by exact columns along the period recorded last.
BorderedVector exact_step(BranchCorrector& corrector, const BorderedSystem& system, const Orbit& orbit,
                          BorderedVector wanted, double accuracy)
{
  BorderedVector step =
      step_by_columns(system, orbit, corrector.parameter_column, std::move(wanted), accuracy, corrector.secants);
  corrector.columns += static_cast<long>(corrector.secants.size());
  return step;
}

/// Records the period of the orbit, and forms the column of p there.
void form_jacobian(BranchCorrector& corrector, const Orbit& orbit)
{
  if (!corrector.parameter_column.get()) corrector.parameter_column = zeros_like(orbit.state);
  corrector.family.parameter_column(orbit.period, orbit.state, corrector.parameter_column);
  corrector.family.flow.record_period(orbit.period, orbit.state, {});
  if (corrector.family.renew_preconditioner) corrector.family.renew_preconditioner();
  corrector.log.convergence.periods += 2;
}

/// Whether an iterate may lead to an orbit of this branch.
bool makes_progress(const BranchCorrector& corrector, const Orbit& orbit, double first_residual)
{
  return std::isfinite(orbit.residual) && orbit.residual < 10 * std::max(first_residual, 1e-3) &&
         orbit.fluctuation < 4 * corrector.scales.fluctuation && orbit.fluctuation > corrector.scales.fluctuation / 20;
}

} // namespace

double scaled_product(const BranchCorrector& corrector, const BorderedVector& a, const BorderedVector& b)
{
  return squeal::scaled_product(corrector.family.flow, corrector.scales, a, b);
}

OrbitProblem problem_of(const BranchCorrector& corrector)
{
  return {corrector.family.flow, corrector.family.preconditioner, copy_of(corrector.rest.get()),
          corrector.period,      corrector.settings.tolerance,    0};
}

BorderedVector vector_of(const CorrectedOrbit& corrected)
{
  return {copy_of(corrected.orbit.state.get()), corrected.orbit.period, corrected.parameter};
}

std::optional<CorrectedOrbit> correct(BranchCorrector& corrector, const BorderedVector& predicted,
                                      const BorderedVector& normal)
{
  const OrbitProblem problem = problem_of(corrector);
  const auto evaluate_at = [&](const BorderedVector& z)
  {
    corrector.family.set_parameter(z.parameter);
    return evaluate(problem, corrector.log, z.state, z.period);
  };
  BorderedVector z = copy_of(predicted);
  Orbit orbit = evaluate_at(z);
  const double first_residual = orbit.residual;
  bool renew = corrector.secants.empty();
  int since_progress = 0, moves = 0, corrections = 0;
  double least = std::numeric_limits<double>::infinity();
  std::optional<CorrectedOrbit> best;
  for (int iteration = 0; iteration <= most_iterations; ++iteration)
  {
    if (!makes_progress(corrector, orbit, first_residual)) break;
    record_full(corrector.log, ShootingStage::multisecant, orbit);
    if (orbit.residual <= problem.tolerance) return CorrectedOrbit{std::move(orbit), z.parameter, corrections};
    if (!(best && best->orbit.residual <= orbit.residual))
      best = CorrectedOrbit{copy_of(orbit), z.parameter, corrections};
    since_progress = orbit.residual < progress * least ? 0 : since_progress + 1;
    least = std::min(least, orbit.residual);
    if (since_progress == steps_without_progress && corrector.settings.steps > 0)
    {
      if (moves == most_moves) break;
      check(VecAXPY(z.state, moved_by * z.period / corrector.settings.steps, orbit.rate));
      orbit = evaluate_at(z);
      since_progress = 0;
      least = std::numeric_limits<double>::infinity();
      renew = true;
      ++moves;
      iteration = -1; // as many again
      continue;
    }
    if (renew) form_jacobian(corrector, orbit);
    const BorderedSystem system = system_at(problem, corrector.scales, orbit, corrector.parameter_column, normal);
    const Owned<Vec> defect = preconditioned(problem, orbit.period, orbit.defect);
    BorderedVector wanted{copy_of(defect.get()), 0, 0};
    close_border(system, {0, 0}, wanted);
    scale(-1, wanted);
    BorderedVector step =
        renew ? exact_step(corrector, system, orbit, std::move(wanted), 0.03)
              : step_by_secants(system, corrector.secants, corrector.options.secant_drop, std::move(wanted));
    const double length = std::sqrt(scaled_product(corrector, step, step));
    if (length > corrector.options.clamp) scale(corrector.options.clamp / length, step);
    add(1, step, z);
    ++corrections;
    if (!admissible_period(problem, z.period)) break;
    Orbit next = evaluate_at(z);
    renew = next.residual > good_reduction * orbit.residual;
    Owned<Vec> change = preconditioned(problem, next.period, next.defect);
    check(VecAXPY(change, -1, defect));
    keep(corrector, {std::move(step), std::move(change)});
    orbit = std::move(next);
  }
  if (moves == most_moves && best && best->orbit.residual <= beside_jump * problem.tolerance) return best;
  return {};
}

BorderedVector tangent_at(BranchCorrector& corrector, const CorrectedOrbit& corrected, const BorderedVector& about)
{
  const Orbit& orbit = corrected.orbit;
  corrector.family.set_parameter(corrected.parameter);
  form_jacobian(corrector, orbit);
  const OrbitProblem problem = problem_of(corrector);
  const BorderedSystem system = system_at(problem, corrector.scales, orbit, corrector.parameter_column, about);
  BorderedVector wanted{zeros_like(orbit.state), 0, 0};
  close_border(system, {0, 1}, wanted);
  BorderedVector tangent = exact_step(corrector, system, orbit, std::move(wanted), 1e-3);
  scale(1 / std::sqrt(scaled_product(corrector, tangent, tangent)), tangent);
  return tangent;
}

} // namespace squeal
