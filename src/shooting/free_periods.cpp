#include "free_periods.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr double smallest_refactored = 0.02; // a correction over the period: shooting makes smaller ones

/// The recurrence nearest to the start is where the defect is orthogonal to the flow. [s], from the period's end.
double nearest_recurrence(const OrbitProblem& problem, const Orbit& orbit)
{
  const double speed = energy_norm(problem.flow, orbit.rate);
  const double away = speed > 0 ? -energy_product(problem.flow, orbit.defect, orbit.rate) / (speed * speed) : 0;
  return std::clamp(away, -0.2 * orbit.period, 0.2 * orbit.period);
}

} // namespace

double return_residual(const OrbitProblem& problem, const Orbit& orbit)
{
  const Owned<Vec> missed = copy_of(orbit.defect.get());
  check(VecAXPY(missed, nearest_recurrence(problem, orbit), orbit.rate));
  return energy_norm(problem.flow, missed) / orbit.fluctuation;
}

Orbit integrate_free_periods(const OrbitProblem& problem, ConvergenceLog& log, Vec state, double period,
                             const FreeIntegration& asked)
{
  Owned<Vec> current = copy_of(state);
  const int at_most = std::max(asked.periods, asked.at_most);
  for (int done = 0; done < (asked.periods > 0 ? at_most : 0); ++done)
  {
    const Orbit orbit = evaluate(problem, log, current, period);
    record(log, ShootingStage::free_periods, orbit, 0, std::nan(""));
    log.slips.push_back(orbit.offsets.slip);
    check(VecAXPY(current, 1, orbit.defect));
    // A new period costs a factorisation, so a small correction waits for the last one.
    const bool enough = done + 1 >= asked.periods || return_residual(problem, orbit) <= asked.near_periodic,
               last = done + 1 == at_most || (enough && !slips_one_way(problem, orbit));
    const double correction = nearest_recurrence(problem, orbit);
    const bool worth_it = last || std::abs(correction) > smallest_refactored * period;
    if (worth_it && admissible_period(problem, period + correction)) period += correction;
    if (last) break;
  }
  Orbit orbit = evaluate(problem, log, current, period);
  if (asked.periods > 0) return orbit;
  // A start that is handed over may have another period than the mode.
  for (int tries = 0; tries < 3; ++tries)
  {
    const double correction = nearest_recurrence(problem, orbit);
    if (!(std::abs(correction) > smallest_refactored * period) || !admissible_period(problem, period + correction))
      break;
    period += correction;
    record(log, ShootingStage::free_periods, orbit, 0, std::nan(""));
    orbit = evaluate(problem, log, current, period);
  }
  return orbit;
}

} // namespace squeal
