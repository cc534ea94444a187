#include "step_refinement.hpp"

#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/cycle/floquet.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

constexpr int most_corrections = 40; // periods of the full model while the steps a period are refined

/// For errors that fall with this power of the steps: the error at c steps over the difference between a and b steps.
double error_fraction(int a, int b, int c, double order)
{
  return std::pow(c, -order) / (std::pow(a, -order) - std::pow(b, -order));
}

double largest(const RelativeChange& errors)
{
  return std::max(errors.frequency, errors.energy);
}

/// The relative error of a cycle's quantity at n steps a period: first/n + second/n^2.
struct StepError
{
  double first = 0, second = 0;

  double at(double steps) const { return (first + second / steps) / steps; }

  /// The number of steps with such an error.
  double steps_for(double error) const { return (first + std::sqrt(first * first + 4 * error * second)) / (2 * error); }

  /// Of the power of n with which the error falls there: 1 to 2.
  double order(double steps) const { return std::log2(at(steps) / at(2 * steps)); }
};

/// Of the last three cycles, a parabola in 1/n. Impacts and onsets of stick have errors of first order, which depend on
/// where in their steps they come: two cycles may agree by chance. So both terms count by their size. Of two cycles, an
/// error of the order given.
StepError step_error(const std::vector<CycleAtSteps>& cycles, double CycleAtSteps::*quantity, int order)
{
  const CycleAtSteps &fine = cycles.back(), &middle = cycles[cycles.size() - 2];
  const auto slope = [&](const CycleAtSteps& a, const CycleAtSteps& b)
  { return (a.*quantity / (fine.*quantity) - b.*quantity / (fine.*quantity)) / (1. / a.steps - 1. / b.steps); };
  const double sum = 1. / middle.steps + 1. / fine.steps, last = slope(middle, fine);
  if (cycles.size() == 2) return order == 1 ? StepError{std::abs(last), 0} : StepError{0, std::abs(last / sum)};
  const CycleAtSteps& coarse = cycles[cycles.size() - 3];
  const double second = (slope(coarse, middle) - last) / (1. / coarse.steps - 1. / fine.steps);
  return {std::abs(last - second * sum), std::abs(second)};
}

CycleAtSteps at_steps(const LimitCycle& cycle)
{
  return {cycle.steps_per_period, cycle.orbit.period, cycle.measured.mean_fluctuating_energy};
}

/// Cycles near one another at several numbers of steps a period.
struct FineShooting
{
  CycleProblem& problem;
  CycleOptions options; // without a verdict, which the last cycle alone is given
  double accuracy = 0;

  /// Shoots until what further steps would change is below half of the accuracy.
  LimitCycle cycle_near(const Owned<Vec>& state, double period, int steps, const Convergence& before)
  {
    const int own = std::exchange(problem.settings.steps_per_period, steps);
    ShootingStart start{problem.sliding.equilibrium.u, displacement(state), velocity(state), period};
    start.is_cycle = true;
    const Finally restore([&] { problem.settings.steps_per_period = own; });
    const int free_periods = has_undriven_pairs(problem.sliding.interface) ? 1 : 0; // until none slips one way
    return find_cycle_from(problem, options, start,
                           {0, free_periods, accuracy / 2, false, "cycle, finer steps", before});
  }

  /// The changes of a cycle on a grid of time that begins half a step later; none where no cycle is found there. Adds
  /// its periods.
  RelativeChange changes_on_moved_grid(LimitCycle& cycle)
  {
    PeriodMap map{problem.sliding, problem.step, cycle.steps_per_period, cycle.theta};
    State later{copy_of(displacement(cycle.orbit.state)), copy_of(velocity(cycle.orbit.state)), 0,
                cycle.measured.start.reactions};
    set_period(map, cycle.orbit.period);
    move_by_part(map, 0.5, later);
    LimitCycle moved =
        cycle_near(state_of(later.u, later.v), cycle.orbit.period, cycle.steps_per_period, cycle.convergence);
    cycle.convergence = std::move(moved.convergence);
    if (moved.outcome.kind != OutcomeKind::converged) return {};
    return {std::abs(moved.orbit.period / cycle.orbit.period - 1),
            std::abs(moved.measured.mean_fluctuating_energy / cycle.measured.mean_fluctuating_energy - 1)};
  }
};

/// The coarse cycle as one that was not found, since only its own steps know it. The motion goes on at twice as many
/// steps from beside it: on a cycle that repels it would stay for hundreds of periods.
void leave(LimitCycle& cycle, Vec equilibrium)
{
  constexpr double smaller = 0.9; // than the cycle, about the equilibrium: contact opens no further
  cycle.outcome.kind = OutcomeKind::not_periodic;
  cycle.outcome.reason = format("a cycle at %d steps a period that finer ones do not know", cycle.steps_per_period);
  cycle.free = copy_of(cycle.orbit);
  check(VecScale(cycle.free.state, smaller));
  check(VecAXPY(displacement(cycle.free.state), 1 - smaller, equilibrium));
  cycle.steps_per_period *= 2;
  cycle.multipliers = {};
}

/// Puts the finer cycle in the place of the one found, with its errors. What the search and the verdict left stays.
void take(LimitCycle finer, const RelativeChange& step_errors, FittedCycle& found)
{
  finer.free = std::move(found.cycle.free);
  finer.multipliers = std::move(found.cycle.multipliers);
  found.fidelity.step_frequency_error = step_errors.frequency;
  found.fidelity.step_energy_error = step_errors.energy;
  found.fidelity.frequency_error = finer.remaining.frequency;
  found.fidelity.energy_error = finer.remaining.energy;
  found.cycle = std::move(finer);
}

/// From the cycle at few steps a period to twice as many and on. Where the cycles agree, so must the last one on a
/// moved grid: those of several numbers of steps may agree by chance. The state of the next one is extrapolated from
/// the last two.
void refine(FineShooting& shooting, FittedCycle& found)
{
  constexpr int most_tries = 6;
  const double accuracy = shooting.accuracy;
  const bool exact = whole_tangent_is_cheap(2. * dofs_of(found.cycle.orbit.state)); // steps
  LimitCycle& cycle = found.cycle;
  std::vector<CycleAtSteps> cycles{at_steps(cycle)};
  Orbit before = copy_of(cycle.orbit);
  double beyond = 0; // how far past the last cycle, on the line from the one before it
  for (int tries = 1, steps = 2 * cycle.steps_per_period;; ++tries)
  {
    const Owned<Vec> start = std::move(before.state);
    check(VecAXPBY(start, 1 + beyond, -beyond, cycle.orbit.state));
    const double period = cycle.orbit.period + beyond * (cycle.orbit.period - before.period);
    before = copy_of(cycle.orbit);
    LimitCycle finer = shooting.cycle_near(start, period, steps, cycle.convergence);
    if (finer.outcome.kind != OutcomeKind::converged)
    {
      cycle.convergence = std::move(finer.convergence);
      found.fidelity.reason = format("the accuracy was not reached in %ld periods of the full model at more steps a "
                                     "period",
                                     cycle.convergence.periods);
      if (tries == 1 && (finer.ending != StageEnding::stalled || exact))
        leave(cycle, shooting.problem.sliding.equilibrium.u);
      return;
    }
    cycles.push_back(at_steps(finer));
    const int last = cycles[cycles.size() - 2].steps;
    RelativeChange errors = step_errors_of(cycles), of_grid; // of the place of contact's events in their steps
    if (largest(errors) <= accuracy / 2) of_grid = shooting.changes_on_moved_grid(finer);
    errors = {std::max(errors.frequency, of_grid.frequency), std::max(errors.energy, of_grid.energy)};
    take(std::move(finer), errors, found);
    if (largest(errors) <= accuracy / 2) return;
    if (tries == most_tries)
    {
      found.fidelity.reason = format("the accuracy needs more than %d steps a period", steps);
      return;
    }
    const StepError of_period = step_error(cycles, &CycleAtSteps::period, 2),
                    of_energy = step_error(cycles, &CycleAtSteps::energy, 2);
    const double needed = std::max({of_period.steps_for(accuracy / 3), of_energy.steps_for(accuracy / 3),
                                    steps * largest(of_grid) / (accuracy / 3)}); // events have errors of first order
    const int now =
        std::exchange(steps, 4 * static_cast<int>(std::ceil(std::clamp(needed, 1.5 * steps, 4. * steps) / 4)));
    const double order = of_energy.order(now);
    beyond = error_fraction(last, now, now, order) - error_fraction(last, now, steps, order);
  }
}

/// Notes that the end of the run cut the refinement short.
void cut_short(FittedCycle& found)
{
  found.cycle.cut_short = true;
  found.fidelity.reason = format("the run was ended at %d steps a period", found.cycle.steps_per_period);
}

} // namespace

RelativeChange step_errors_of(const std::vector<CycleAtSteps>& cycles)
{
  const int steps = cycles.back().steps;
  return {step_error(cycles, &CycleAtSteps::period, 1).at(steps),
          step_error(cycles, &CycleAtSteps::energy, 1).at(steps)};
}

void refine_steps(CycleProblem& problem, const CycleOptions& options, FittedCycle& found)
{
  LimitCycle& cycle = found.cycle;
  const int coarse = cycle.steps_per_period;
  try
  {
    FineShooting shooting{problem, options, found.fidelity.accuracy};
    shooting.options.shooting.multipliers = 0;
    shooting.options.shooting.max_periods = cycle.convergence.periods + most_corrections;
    refine(shooting, found);
  }
  catch (const Interrupted&) // on all ranks alike: the cycle that was found stays
  {
    cut_short(found);
  }
  found.fidelity.full_periods = cycle.convergence.periods;
  // impacts may make a cycle repel that attracts at few steps; where that costs too much, the bars at few hold it
  const Structure& structure = problem.sliding.structure;
  const int judged = steps_of_verdict(structure, cycle.steps_per_period);
  if (cycle.cut_short || cycle.outcome.kind != OutcomeKind::converged || cycle.steps_per_period == coarse ||
      is_dear(judged * work_of_step(structure)))
    return;
  Verdict verdict = examine(problem, options, cycle);
  if (verdict.cut_short) return cut_short(found);
  refuse_repelling(verdict, problem.unstable.modes.size() - 1, cycle.outcome);
  cycle.multipliers = std::move(verdict.floquet.multipliers);
  found.fidelity.verdict_steps = judged;
}

} // namespace squeal
