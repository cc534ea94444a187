#include "step_refinement.hpp"

#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/cycle/floquet.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

namespace squeal
{

namespace
{

constexpr int most_corrections = 60; // periods of the full model while the steps a period are refined

/// Of errors of order 2: the error at c steps over the difference between a and b steps.
double error_fraction(int a, int b, int c)
{
  return std::pow(c, -2) / (std::pow(a, -2) - std::pow(b, -2));
}

double largest(const RelativeChange& errors)
{
  return std::max(errors.frequency, errors.energy);
}

/// The relative error of the last cycle's quantity, from its change since each of the others. Errors of order 2 fall
/// alike, or depend on where in their steps pairs stick and open, so that the largest counts. Impacts have errors of
/// order 1, which the last two changes show.
double step_error(const std::vector<CycleAtSteps>& cycles, double CycleAtSteps::*quantity)
{
  constexpr double alike = 1.5;
  const CycleAtSteps& last = cycles.back();
  double first = HUGE_VAL, least = HUGE_VAL, most = 0;
  for (const CycleAtSteps& other : std::span(cycles).first(cycles.size() - 1))
  {
    const double change = std::abs(other.*quantity / (last.*quantity) - 1),
                 ratio = static_cast<double>(other.steps) / last.steps,
                 second = change * ratio * ratio / std::abs(1 - ratio * ratio);
    if (&cycles.back() - &other <= 2) first = std::min(first, change * ratio / std::abs(1 - ratio));
    least = std::min(least, second);
    most = std::max(most, second);
  }
  return cycles.size() > 3 && most <= alike * least ? alike * most : std::max(first, most);
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
  bool exact = false; // steps of the iteration

  /// Shoots until what further steps would change is below half of the accuracy; where the steps are exact below a
  /// twentieth, unless that stalls: cycles on two grids are compared.
  LimitCycle cycle_near(const Owned<Vec>& state, double period, int steps, const Convergence& before)
  {
    const int own = std::exchange(problem.settings.steps_per_period, steps);
    const Finally restore([&] { problem.settings.steps_per_period = own; });
    const int free_periods = has_undriven_pairs(problem.sliding.interface) ? 1 : 0; // until none slips one way
    const auto shoot_to = [&](double target_error, Vec from, double first_period, const Convergence& so_far)
    {
      ShootingStart start{problem.sliding.equilibrium.u, displacement(from), velocity(from), first_period};
      start.is_cycle = true;
      return find_cycle_from(problem, options, start,
                             {0, free_periods, target_error, false, "cycle, finer steps", so_far});
    };
    LimitCycle cycle = shoot_to(accuracy / (exact ? 20 : 2), state, period, before);
    if (!exact || cycle.ending != StageEnding::stalled) return cycle;
    return shoot_to(accuracy / 2, cycle.orbit.state, cycle.orbit.period, cycle.convergence);
  }

  /// Whether a motion that starts on the cycle leaves it at `steps` steps a period: in the end it comes back less near
  /// than at first, and not as near as motions beside a cycle are watched. Adds its periods.
  bool is_left(LimitCycle& cycle, int steps)
  {
    constexpr int seen = 20;
    constexpr double beside = 0.03; // of the fluctuation; contact within steps scatters a motion that stays by less
    PeriodMap map{problem.sliding, problem.step, steps, cycle.theta};
    map.reactions = problem.sliding.equilibrium.reactions;
    const Flow flow = flow_of(map);
    const Preconditioner none;
    const Orbit& orbit = cycle.orbit;
    const OrbitProblem around =
        problem_of(flow, none, {problem.sliding.equilibrium.u, nullptr, nullptr, orbit.period}, 0);
    Progress progress(comm_of(orbit.state), "cycle, finer steps", seen);
    ConvergenceLog log{progress, cycle.convergence};
    const double first = return_residual(around, evaluate(around, log, orbit.state, orbit.period));
    const Orbit free = integrate_free_periods(around, log, orbit.state, orbit.period, {seen});
    cycle.convergence = std::move(log.convergence);
    return !(return_residual(around, free) <= std::max(first, beside));
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

/// The cycle as one that was not found, since only its own steps know it. The motion goes on at twice as many steps
/// from beside it: on a cycle that repels it would stay for hundreds of periods.
void leave(FittedCycle& found, Vec equilibrium)
{
  constexpr double smaller = 0.9; // than the cycle, about the equilibrium: contact opens no further
  LimitCycle& cycle = found.cycle;
  Fidelity& fidelity = found.fidelity;
  cycle.outcome.kind = OutcomeKind::not_periodic;
  cycle.outcome.reason = format("a cycle at %d steps a period that finer ones do not know", cycle.steps_per_period);
  cycle.free = copy_of(cycle.orbit);
  check(VecScale(cycle.free.state, smaller));
  check(VecAXPY(displacement(cycle.free.state), 1 - smaller, equilibrium));
  cycle.steps_per_period *= 2;
  cycle.multipliers = {};
  fidelity.frequency_error = fidelity.energy_error = std::nan("");
  fidelity.step_frequency_error = fidelity.step_energy_error = std::nan("");
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
/// moved grid: those of several numbers of steps may agree by chance. Where the steps of the iteration are exact, four
/// times as many steps a period must know the cycle, too: at fewer a grid may hold a cycle that attracts nothing else.
/// The state of the next one is extrapolated from the last two.
void refine(FineShooting& shooting, FittedCycle& found)
{
  constexpr int most_tries = 6;
  const double accuracy = shooting.accuracy;
  LimitCycle& cycle = found.cycle;
  std::vector<CycleAtSteps> cycles{at_steps(cycle)};
  Orbit before = copy_of(cycle.orbit);
  double beyond = 0; // how far past the last cycle, on the line from the one before it
  bool accurate = false;
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
      if (!accurate)
        found.fidelity.reason = format("the accuracy was not reached in %ld periods of the full model at more steps a "
                                       "period",
                                       cycle.convergence.periods);
      if (finer.ending != StageEnding::stalled || shooting.is_left(cycle, steps))
        leave(found, shooting.problem.sliding.equilibrium.u);
      return;
    }
    cycles.push_back(at_steps(finer));
    const int last = cycles[cycles.size() - 2].steps;
    const bool confirmed = accurate || !shooting.exact;
    RelativeChange errors = step_errors_of(cycles), of_grid; // of the place of contact's events in their steps
    if (confirmed && largest(errors) <= accuracy / 2) of_grid = shooting.changes_on_moved_grid(finer);
    errors.frequency += of_grid.frequency;
    errors.energy += of_grid.energy;
    take(std::move(finer), errors, found);
    accurate = largest(errors) <= accuracy / 2;
    if (accurate && confirmed) return;
    if (tries >= most_tries && !accurate)
    {
      found.fidelity.reason = format("the accuracy needs more than %d steps a period", steps);
      return;
    }
    const double needed = steps * (accurate ? 4 : std::sqrt(largest(errors) / (accuracy / 3)));
    const int now =
        std::exchange(steps, 4 * static_cast<int>(std::ceil(std::clamp(needed, 1.5 * steps, 4. * steps) / 4)));
    beyond = error_fraction(last, now, now) - error_fraction(last, now, steps);
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
  return {step_error(cycles, &CycleAtSteps::period), step_error(cycles, &CycleAtSteps::energy)};
}

void refine_steps(CycleProblem& problem, const CycleOptions& options, FittedCycle& found)
{
  LimitCycle& cycle = found.cycle;
  const int coarse = cycle.steps_per_period;
  try
  {
    FineShooting shooting{problem, options, found.fidelity.accuracy,
                          whole_tangent_is_cheap(2. * dofs_of(cycle.orbit.state))};
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
  if (cycle.outcome.kind != OutcomeKind::converged) cycle.steps_per_period = 2 * coarse; // of the motion that goes on
  cycle.multipliers = std::move(verdict.floquet.multipliers);
  found.fidelity.verdict_steps = judged;
}

} // namespace squeal
