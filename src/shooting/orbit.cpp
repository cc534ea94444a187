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

namespace
{

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
    record(log, ShootingStage::free_periods, orbit, 0);
    log.slips.push_back(orbit.offsets.slip);
    check(VecAXPY(current, 1, orbit.defect));
    // A new period costs a factorisation, so a small correction waits for the last one.
    const bool enough = done + 1 >= asked.periods || return_residual(problem, orbit) <= asked.near_periodic ||
                        !(orbit.fluctuation <= asked.outgrown),
               last = done + 1 == at_most || (enough && !slips_one_way(problem, orbit));
    const double correction = nearest_recurrence(problem, orbit);
    const bool worth_it = last || std::abs(correction) > asked.refactored * period;
    if (worth_it && admissible_period(problem, period + correction)) period += correction;
    if (last) break;
  }
  Orbit orbit = evaluate(problem, log, current, period);
  if (asked.periods > 0) return orbit;
  // A start that is handed over may have another period than the mode.
  for (int tries = 0; tries < 3; ++tries)
  {
    const double correction = nearest_recurrence(problem, orbit);
    if (!(std::abs(correction) > asked.refactored * period) || !admissible_period(problem, period + correction)) break;
    period += correction;
    record(log, ShootingStage::free_periods, orbit, 0);
    orbit = evaluate(problem, log, current, period);
  }
  return orbit;
}

} // namespace squeal
