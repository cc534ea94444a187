#include "free_periods.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

Orbit integrate_free_periods(const OrbitProblem& problem, ConvergenceLog& log, Vec state, double period, int count)
{
  Owned<Vec> current = copy_of(state);
  for (int done = 0; done < count; ++done)
  {
    const Orbit orbit = evaluate(problem, log, current, period);
    record(log, ShootingStage::free_periods, orbit, 0, std::nan(""));
    check(VecAXPY(current, 1, orbit.defect));
    // The recurrence nearest to the start lies where the defect is orthogonal to the flow. A new period costs a
    // factorisation, so a small correction waits for the last one.
    const double speed = energy_norm(problem.flow, orbit.rate);
    double correction = speed > 0 ? -energy_product(problem.flow, orbit.defect, orbit.rate) / (speed * speed) : 0;
    correction = std::clamp(correction, -0.2 * period, 0.2 * period);
    const bool worth_it = done + 1 == count || std::abs(correction) > 0.02 * period;
    if (worth_it && admissible_period(problem, period + correction)) period += correction;
  }
  return evaluate(problem, log, current, period);
}

} // namespace squeal
