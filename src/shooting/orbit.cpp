#include "squeal/shooting/orbit.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

Orbit copy_of(const Orbit& orbit)
{
  Orbit copy{copy_of(orbit.state), orbit.period,      copy_of(orbit.defect),
             copy_of(orbit.rate),  orbit.fluctuation, orbit.residual};
  if (orbit.rest.get()) copy.rest = copy_of(orbit.rest);
  copy.offsets = orbit.offsets;
  return copy;
}

Orbit evaluate(const OrbitProblem& problem, ConvergenceLog& log, Vec state, double period)
{
  Orbit orbit{copy_of(state), period, zeros_like(state), zeros_like(state), 0, 0};
  problem.flow.integrate(period, orbit.state, orbit.defect, orbit.rate);
  ++log.convergence.periods;
  check(VecAXPY(orbit.defect, -1, orbit.state));
  if (const Offsets& offsets = problem.flow.offsets; offsets.motion)
  {
    orbit.offsets = offsets.motion();
    orbit.rest = copy_of(problem.equilibrium.get());
    offsets.find_rest(orbit.rest);
  }
  const Owned<Vec> fluctuation = fluctuation_of(problem, orbit);
  orbit.fluctuation = energy_norm(problem.flow, fluctuation);
  orbit.residual = energy_norm(problem.flow, orbit.defect) / orbit.fluctuation;
  // 0/0: the equilibrium itself, which is no cycle
  if (!std::isfinite(orbit.residual)) orbit.residual = std::numeric_limits<double>::infinity();
  return orbit;
}

void record(ConvergenceLog& log, ShootingStage stage, const Orbit& orbit, PetscInt unknowns, double residual_projected)
{
  Convergence& convergence = log.convergence;
  convergence.records.push_back(
      {stage, unknowns, convergence.periods, orbit.period, residual_projected, orbit.residual});
  log.progress.update(log.done.value_or(static_cast<double>(convergence.periods)),
                      format("%s, %ld periods, T %.6g s, residual %.1e", word(stage), convergence.periods, orbit.period,
                             orbit.residual));
}

void record_full(ConvergenceLog& log, ShootingStage stage, const Orbit& orbit)
{
  record(log, stage, orbit, 2 * dofs_of(orbit.state) + 1, std::nan(""));
}

bool admissible_period(const OrbitProblem& problem, double period)
{
  return period > problem.first_period / 2 && period < problem.first_period * 2;
}

bool collapsing(const OrbitProblem& problem, const Orbit& orbit)
{
  return !(orbit.fluctuation > problem.least_fluctuation);
}

bool slips_one_way(const OrbitProblem& problem, const Orbit& orbit)
{
  constexpr double least = 1e-6, of_accuracy = 1e-5;
  const double allowed = problem.tolerance > 0 ? std::max(problem.tolerance, least) : of_accuracy;
  return orbit.offsets.slip > allowed * orbit.offsets.swing;
}

Owned<Vec> fluctuation_of(const OrbitProblem& problem, const Orbit& orbit)
{
  Owned<Vec> fluctuation = copy_of(orbit.state.get());
  check(VecAXPY(fluctuation, -1, orbit.rest.get() ? orbit.rest.get() : problem.equilibrium.get()));
  return fluctuation;
}

} // namespace squeal
