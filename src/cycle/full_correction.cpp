#include "full_correction.hpp"

#include "floquet.hpp"
#include "squeal/shooting/multisecant.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

/// A cycle at some number of steps a period.
struct CycleAtSteps
{
  int steps = 0;
  double period = 0, energy = 0; // [s], [J]
};

/// For errors that fall with this power of the steps: the error at c steps over the difference between a and b steps.
double error_fraction(int a, int b, int c, double order)
{
  return std::pow(c, -order) / (std::pow(a, -order) - std::pow(b, -order));
}

/// Errors of a cycle from another with more or fewer steps.
void estimate_step_errors(Fidelity& fidelity, const CycleAtSteps& other, const CycleAtSteps& cycle, double order)
{
  const double fraction = std::abs(error_fraction(other.steps, cycle.steps, cycle.steps, order));
  fidelity.step_frequency_error = fraction * std::abs(other.period / cycle.period - 1);
  fidelity.step_energy_error = fraction * std::abs(other.energy / cycle.energy - 1);
}

double largest_step_error(const Fidelity& fidelity)
{
  return std::max(fidelity.step_frequency_error, fidelity.step_energy_error);
}

/// The order at which three energies converge: 2 where the motion is smooth, less through impacts, never below 1.
double observed_order(const CycleAtSteps& coarse, const CycleAtSteps& middle, const CycleAtSteps& fine)
{
  const double seen = (coarse.energy - middle.energy) / (middle.energy - fine.energy);
  double order = 1;
  const auto expected = [&](double p)
  {
    return (std::pow(coarse.steps, -p) - std::pow(middle.steps, -p)) /
           (std::pow(middle.steps, -p) - std::pow(fine.steps, -p));
  };
  while (order < 2 && expected(order) < seen) order += 0.05;
  return order;
}

/// The full model's shooting, from one number of steps a period to the next.
struct FullShooting
{
  ReducedSearch& search;
  const OrbitProblem& problem;
  ShootingOptions options;
  ConvergenceLog& log;
  PeriodMap& map;
  const MeasuredPeriod& measured; // of the last period integrated
  Multisecant multisecant{};
  Orbit orbit{};

  CycleAtSteps cycle() const { return {map.steps, orbit.period, measured.mean_fluctuating_energy}; }
};

void restart(FullShooting& shooting, Vec state, double period, int steps)
{
  shooting.map.steps = steps;
  shooting.orbit = evaluate(shooting.problem, shooting.log, state, period);
  record_full(shooting.log, ShootingStage::full_period, shooting.orbit);
}

/// Shoots until what further steps would change is below half of the accuracy, as two steps say: one alone may change
/// the energy by nothing by chance. Returns why it did not get there, or nothing.
std::string shoot_to_accuracy(FullShooting& shooting)
{
  shooting.multisecant.last_step = {HUGE_VAL, HUGE_VAL};
  shooting.multisecant.target_error = shooting.search.fidelity.accuracy / 2;
  StageResult found =
      shoot_by_multisecant(shooting.problem, shooting.options, shooting.log, shooting.multisecant, shooting.orbit);
  shooting.orbit = std::move(found.orbit);
  if (found.ending == StageEnding::converged) return {};
  return "the accuracy was not reached in " + std::to_string(shooting.log.convergence.periods) +
         " periods of the full model";
}

/// Shoots from two cycles' extrapolation to `steps` steps a period: one or two periods do. `last` is the coarse cycle's
/// orbit and becomes the fine one's.
std::string shoot_extrapolated(FullShooting& shooting, Orbit& last, double beyond, int steps)
{
  Orbit now = std::exchange(shooting.orbit, {});
  check(VecAXPBY(last.state, 1 + beyond, -beyond, now.state));
  restart(shooting, last.state, now.period + beyond * (now.period - last.period), steps);
  last = std::move(now);
  return shoot_to_accuracy(shooting);
}

/// The cycle at few steps a period and at twice as many; where these are still too few, at as many as the errors of
/// both foretell. Returns why the accuracy was not reached, or nothing.
std::string refine_steps(FullShooting& shooting)
{
  Fidelity& fidelity = shooting.search.fidelity;
  if (const std::string problem = shoot_to_accuracy(shooting); !problem.empty()) return problem;
  Orbit last = copy_of(shooting.orbit);
  CycleAtSteps coarse = shooting.cycle();
  restart(shooting, last.state, last.period, 2 * coarse.steps);
  if (const std::string problem = shoot_to_accuracy(shooting); !problem.empty()) return problem;
  CycleAtSteps fine = shooting.cycle();
  double sure = 1, likely = 2; // orders, until a third number of steps tells
  for (int tries = 0;; ++tries)
  {
    shooting.search.steps = fine.steps;
    estimate_step_errors(fidelity, coarse, fine, likely);
    const double needed = fine.steps * std::pow(3 * largest_step_error(fidelity) / fidelity.accuracy, 1 / likely);
    estimate_step_errors(fidelity, coarse, fine, sure);
    if (largest_step_error(fidelity) <= fidelity.accuracy / 2) return {};
    if (tries == 5) return "the accuracy needs more than " + std::to_string(fine.steps) + " steps a period";
    const int steps = 4 * static_cast<int>(std::ceil(std::max(needed, 1.5 * fine.steps) / 4));
    const double beyond = error_fraction(coarse.steps, fine.steps, fine.steps, likely) -
                          error_fraction(coarse.steps, fine.steps, steps, likely);
    if (const std::string problem = shoot_extrapolated(shooting, last, beyond, steps); !problem.empty()) return problem;
    sure = likely = observed_order(coarse, fine, shooting.cycle());
    coarse = std::exchange(fine, shooting.cycle());
  }
}

/// The reduced model's cycle at twice as many steps gives the step's errors.
void estimate_reduced_step_errors(ReducedSearch& search, const ReducedCycle& cycle)
{
  Fidelity& fidelity = search.fidelity;
  const ReducedCycle twice = find_reduced_cycle(search, cycle, 2 * search.steps);
  estimate_step_errors(fidelity, {2 * search.steps, twice.period, twice.energy},
                       {search.steps, cycle.period, cycle.energy}, 1);
  if (!twice.converged) fidelity.step_frequency_error = fidelity.step_energy_error = std::nan("");
}

} // namespace

std::string correct_on_full_model(ReducedSearch& search, const ShootingStart& start,
                                  const Preconditioner& preconditioner, const ReducedCycle& reduced, LimitCycle& result)
{
  const double clock = MPI_Wtime();
  const CycleProblem& given = search.problem;
  Fidelity& fidelity = search.fidelity;
  if (fidelity.asked == CycleModel::reduced) estimate_reduced_step_errors(search, reduced);
  PeriodMap map{given.sliding, given.step, search.steps, given.settings.theta};
  map.reactions = given.sliding.equilibrium.reactions;
  map.options.contact.tolerance = fidelity.contact_tolerance;
  MeasuredPeriod measured;
  const Recording recording{given.probes, static_cast<int>(search.options.samples)};
  const auto integrate = [&](double period, Vec from, Vec end, Vec rate)
  {
    measured = measure_period(map, recording, period, from, rate);
    check(VecCopy(measured.end.u, displacement(end)));
    check(VecCopy(measured.end.v, velocity(end)));
  };
  const Flow flow{integrate, given.sliding.structure.M, given.sliding.structure.K};
  Progress progress(comm_of(start.u), "cycle", 20);
  ConvergenceLog log{progress};
  const OrbitProblem problem = problem_of(flow, preconditioner, start, 0);
  FullShooting shooting{search, problem, search.options.shooting, log, map, measured};
  shooting.options.max_periods = search.options.reduced.corrections;
  const Owned<Vec> first = state_of(start.u, start.v);
  restart(shooting, first, start.period, search.steps);
  std::string reason;
  if (fidelity.asked == CycleModel::automatic)
    reason = refine_steps(shooting);
  else
    estimate_remaining_change(problem, shooting.options, shooting.multisecant, shooting.orbit);

  fidelity.steps_per_period = map.steps;
  fidelity.full_periods = log.convergence.periods;
  fidelity.frequency_error = shooting.multisecant.remaining.frequency;
  fidelity.energy_error = shooting.multisecant.remaining.energy;
  fidelity.full_seconds += MPI_Wtime() - clock;
  result.outcome = {OutcomeKind::converged, "", log.convergence.iterations, shooting.orbit.residual};
  if (reason.empty()) result.multipliers = examine(given, shooting.options, map, shooting.orbit).multipliers;
  refuse_repelling(result.multipliers, given.unstable.modes.size() - 1, result.outcome);
  result.steps_per_period = map.steps;
  result.theta = map.theta;
  result.orbit = std::move(shooting.orbit);
  result.convergence = std::move(log.convergence);
  result.measured = std::move(measured);
  result.costs = {map.step.factor_seconds, map.step.condensed_seconds};
  return reason;
}

} // namespace squeal
