#include "squeal/shooting/full_space.hpp"

#include "free_periods.hpp"
#include "newton_krylov.hpp"
#include "squeal/shooting/multisecant.hpp"

namespace squeal
{

StageResult shoot_in_full_space(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                Orbit start)
{
  StageResult result{std::move(start), StageEnding::stalled};
  if (result.orbit.residual <= problem.tolerance) return {std::move(result.orbit), StageEnding::converged};
  if (options.finish == Finish::none) return result;
  if (options.finish == Finish::multisecant)
  {
    Multisecant first, second;
    result = shoot_by_multisecant(problem, options, log, first, result.orbit);
    if (result.ending == StageEnding::converged) return result;
    if (log.convergence.periods < options.max_periods)
    {
      Orbit again = integrate_free_periods(problem, log, result.orbit.state, result.orbit.period, 10);
      if (collapsing(problem, again)) return {std::move(again), StageEnding::collapsed};
      result = shoot_by_multisecant(problem, options, log, second, again);
      if (result.ending == StageEnding::converged) return result;
    }
  }
  if (log.convergence.periods >= options.max_periods) return result;
  const StageEnding before = result.ending;
  result = shoot_by_newton_krylov(problem, options, log, result.orbit);
  if (result.ending == StageEnding::stalled) result.ending = before;
  return result;
}

} // namespace squeal
