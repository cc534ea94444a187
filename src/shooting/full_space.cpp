#include "squeal/shooting/full_space.hpp"

#include "free_periods.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/shooting/multisecant.hpp"

namespace squeal
{

StageResult shoot_once(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log, Orbit start)
{
  if (start.residual <= problem.tolerance) return {std::move(start), StageEnding::converged};
  if (options.finish == Finish::none) return {std::move(start), StageEnding::stalled};
  Multisecant memory;
  memory.exact = problem.flow.apply_tangent && whole_tangent_is_cheap(2. * dofs_of(problem.equilibrium));
  return shoot_by_multisecant(problem, options, log, memory, start);
}

StageResult shoot_in_full_space(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                Orbit start)
{
  StageResult result = shoot_once(problem, options, log, std::move(start));
  const bool given_up = result.ending != StageEnding::converged && log.convergence.periods < options.max_periods;
  if (!given_up || options.finish == Finish::none) return result;
  Orbit again = integrate_free_periods(problem, log, result.orbit.state, result.orbit.period, {10, 0});
  if (collapsing(problem, again)) return {std::move(again), StageEnding::collapsed};
  return shoot_once(problem, options, log, std::move(again));
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
      if (!(part.residual < 1e-2)) continue;
      StageResult shorter = shoot_in_full_space(once, options, log, std::move(part));
      if (shorter.ending == StageEnding::converged) found = std::move(shorter);
    }
  return found;
}

} // namespace squeal
