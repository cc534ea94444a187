#include "step_refinement.hpp"

#include "squeal/cycle/floquet.hpp"

#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/cycle/limit_cycle.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
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

/// The problem without a tolerance: the accuracy ends the iteration.
OrbitProblem orbit_problem(const CycleCorrection& correction, const Flow& flow, double period)
{
  const Vec u0 = correction.problem.sliding.equilibrium.u;
  return problem_of(flow, correction.preconditioner, {u0, nullptr, nullptr, period}, 0);
}

/// The full model's iteration, from one number of steps a period to the next. Every period is measured, on contact as
/// exact as the accuracy needs.
class FineShooting
{
public:
  FineShooting(const CycleCorrection& correction, double accuracy, const LimitCycle& coarse)
      : correction_(correction),
        options_(correction.options.shooting), map_{correction.problem.sliding, correction.problem.step,
                                                    coarse.steps_per_period, coarse.theta},
        orbit_(copy_of(coarse.orbit)),
        before_(copy_of(coarse.orbit)), flow_{[this](double period, Vec from, Vec end, Vec rate)
                                              { measure(period, from, end, rate); },
                                              map_.sliding.structure.M, map_.sliding.structure.K},
        problem_(orbit_problem(correction, flow_, coarse.orbit.period)),
        progress_(comm_of(map_.sliding.structure.load), "cycle, finer steps", 20), log_{progress_, coarse.convergence}
  {
    map_.reactions = map_.sliding.equilibrium.reactions;
    map_.options.contact.tolerance = std::min(map_.options.contact.tolerance, 1e-3 * accuracy);
    options_.max_periods = log_.convergence.periods + most_corrections;
    multisecant_.target_error = accuracy / 2;
    multisecant_.exact = whole_tangent_is_cheap(2. * dofs_of(coarse.orbit.state));
    add_tangent(map_, flow_);
    keep_cycles_of(flow_, map_.sliding.structure);
  }
  FineShooting(const FineShooting&) = delete;
  FineShooting& operator=(const FineShooting&) = delete;

  CycleAtSteps cycle() const { return {map_.steps, orbit_.period, measured_.mean_fluctuating_energy}; }
  const Convergence& convergence() const { return log_.convergence; }
  const Multisecant& multisecant() const { return multisecant_; }

  /// Shoots from the extrapolation of the last two cycles to `steps` steps a period: one or two periods do. `beyond`:
  /// how far past the last cycle, on the line from the one before it. Where none is found, the last one stands.
  StageEnding shoot_extrapolated(double beyond, int steps)
  {
    Orbit now = std::exchange(orbit_, {});
    MeasuredPeriod measured = std::move(measured_);
    const int before = std::exchange(map_.steps, steps);
    check(VecAXPBY(before_.state, 1 + beyond, -beyond, now.state));
    const double period = now.period + beyond * (now.period - before_.period);
    const Owned<Vec> start = std::exchange(before_, std::move(now)).state;
    const StageEnding ending = shoot_from(start, period);
    if (ending == StageEnding::converged) return ending;
    orbit_ = std::move(before_);
    measured_ = std::move(measured);
    map_.steps = before;
    return ending;
  }

  /// The last cycle on a grid of time that begins half a step later; nothing where none is found.
  std::optional<CycleAtSteps> cycle_on_moved_grid()
  {
    Orbit own = std::exchange(orbit_, {});
    MeasuredPeriod measured = std::move(measured_);
    State later{copy_of(displacement(own.state)), copy_of(velocity(own.state)), 0, measured.start.reactions};
    set_period(map_, own.period);
    move_by_part(map_, 0.5, later);
    const StageEnding ending = shoot_from(state_of(later.u, later.v), own.period);
    const CycleAtSteps moved = cycle();
    orbit_ = std::move(own);
    measured_ = std::move(measured);
    return ending == StageEnding::converged ? std::optional(moved) : std::nullopt;
  }

  /// The coarse cycle with the finest one in its place.
  LimitCycle result(LimitCycle cycle)
  {
    cycle.tolerance = 0;
    cycle.outcome.residual = orbit_.residual;
    cycle.steps_per_period = map_.steps;
    cycle.orbit = std::move(orbit_);
    cycle.measured = std::move(measured_);
    cycle.costs = {map_.step.factor_seconds, map_.step.condensed_seconds};
    return cycle;
  }

private:
  void measure(double period, Vec from, Vec end, Vec rate)
  {
    measured_ = measure_period(map_, {correction_.problem.probes, correction_.options.samples}, period, from, rate);
    check(VecCopy(measured_.end.u, displacement(end)));
    check(VecCopy(measured_.end.v, velocity(end)));
  }

  /// Shoots until what further steps would change is below half of the accuracy, as two steps say: one alone may change
  /// the energy by nothing by chance.
  StageEnding shoot_from(const Owned<Vec>& start, double period)
  {
    const Orbit first = evaluate(problem_, log_, start, period);
    record_full(log_, ShootingStage::full_period, first);
    multisecant_.last_step = {HUGE_VAL, HUGE_VAL};
    StageResult found = shoot_by_multisecant(problem_, options_, log_, multisecant_, first);
    orbit_ = std::move(found.orbit);
    return found.ending;
  }

  const CycleCorrection& correction_;
  ShootingOptions options_;
  PeriodMap map_;
  Orbit orbit_, before_; // the last one; that of the steps before
  MeasuredPeriod measured_{};
  Flow flow_;
  OrbitProblem problem_;
  Progress progress_;
  ConvergenceLog log_;
  Multisecant multisecant_{};
};

/// Errors of the step, and why the accuracy was not reached; empty: it was.
struct Refinement
{
  RelativeChange step_errors{};
  std::string reason{};
  bool finer = false;  // a cycle was found at more steps
  bool leaves = false; // twice as many steps led away from the coarse cycle
};

/// From the cycle at few steps a period to twice as many and on. Where the cycles agree, so must the last one on a
/// moved grid: those of several numbers of steps may agree by chance.
Refinement refine(FineShooting& shooting, double accuracy, const CycleAtSteps& coarse)
{
  constexpr int most_tries = 6;
  std::vector<CycleAtSteps> cycles{coarse};
  Refinement result;
  double beyond = 0;
  for (int tries = 1, steps = 2 * coarse.steps;; ++tries)
  {
    if (const StageEnding ending = shooting.shoot_extrapolated(beyond, steps); ending != StageEnding::converged)
    {
      result.leaves = !result.finer && (ending != StageEnding::stalled || shooting.multisecant().exact);
      result.reason = format("the accuracy was not reached in %ld periods of the full model at more steps a period",
                             shooting.convergence().periods);
      return result;
    }
    result.finer = true;
    cycles.push_back(shooting.cycle());
    const int before = cycles[cycles.size() - 2].steps, now = cycles.back().steps;
    result.step_errors = step_errors_of(cycles);
    RelativeChange of_grid; // of the place of contact's events in their steps
    if (largest(result.step_errors) <= accuracy / 2)
      if (const auto moved = shooting.cycle_on_moved_grid())
        of_grid = {std::abs(moved->period / cycles.back().period - 1),
                   std::abs(moved->energy / cycles.back().energy - 1)};
    result.step_errors = {std::max(result.step_errors.frequency, of_grid.frequency),
                          std::max(result.step_errors.energy, of_grid.energy)};
    if (largest(result.step_errors) <= accuracy / 2) return result;
    if (tries == most_tries)
    {
      result.reason = format("the accuracy needs more than %d steps a period", now);
      return result;
    }
    const StepError of_period = step_error(cycles, &CycleAtSteps::period, 2),
                    of_energy = step_error(cycles, &CycleAtSteps::energy, 2);
    const double needed = std::max({of_period.steps_for(accuracy / 3), of_energy.steps_for(accuracy / 3),
                                    now * largest(of_grid) / (accuracy / 3)}); // events have errors of first order
    steps = 4 * static_cast<int>(std::ceil(std::clamp(needed, 1.5 * now, 4. * now) / 4));
    const double order = of_energy.order(now);
    beyond = error_fraction(before, now, now, order) - error_fraction(before, now, steps, order);
  }
}

/// The coarse cycle as one that was not found, since only its own steps know it. The motion goes on at twice as many
/// steps from beside it: on a cycle that repels it would stay for hundreds of periods.
LimitCycle left(LimitCycle cycle, Vec equilibrium)
{
  constexpr double smaller = 0.9; // than the cycle, about the equilibrium: contact opens no further
  cycle.outcome.kind = OutcomeKind::not_periodic;
  cycle.outcome.reason = format("a cycle at %d steps a period that finer ones do not know", cycle.steps_per_period);
  cycle.free = copy_of(cycle.orbit);
  check(VecScale(cycle.free.state, smaller));
  check(VecAXPY(displacement(cycle.free.state), 1 - smaller, equilibrium));
  cycle.steps_per_period *= 2;
  cycle.multipliers = {};
  return cycle;
}

} // namespace

RelativeChange step_errors_of(const std::vector<CycleAtSteps>& cycles)
{
  const int steps = cycles.back().steps;
  return {step_error(cycles, &CycleAtSteps::period, 1).at(steps),
          step_error(cycles, &CycleAtSteps::energy, 1).at(steps)};
}

FittedCycle refine_steps(const CycleCorrection& correction, FittedCycle found)
{
  LimitCycle& cycle = found.cycle;
  Fidelity& fidelity = found.fidelity;
  if (cycle.outcome.kind != OutcomeKind::converged) return found;
  const CycleProblem& problem = correction.problem;
  try
  {
    FineShooting shooting(correction, fidelity.accuracy, cycle);
    const Refinement refinement =
        refine(shooting, fidelity.accuracy,
               {cycle.steps_per_period, cycle.orbit.period, cycle.measured.mean_fluctuating_energy});
    cycle.convergence = shooting.convergence();
    fidelity.full_periods = cycle.convergence.periods;
    if (!refinement.reason.empty()) fidelity.reason = refinement.reason;
    if (refinement.leaves) cycle = left(std::move(cycle), problem.sliding.equilibrium.u);
    if (!refinement.finer) return found;
    fidelity.step_frequency_error = refinement.step_errors.frequency;
    fidelity.step_energy_error = refinement.step_errors.energy;
    fidelity.frequency_error = shooting.multisecant().remaining.frequency;
    fidelity.energy_error = shooting.multisecant().remaining.energy;
    cycle = shooting.result(std::move(cycle));
  }
  catch (const Interrupted&) // on all ranks alike: the cycle that was found stays
  {
    cycle.cut_short = true;
    fidelity.reason = format("the run was ended at %d steps a period", cycle.steps_per_period);
  }
  // impacts may make a cycle repel that attracts at few steps; where that costs too much, the bars at few hold it
  const Structure& structure = problem.sliding.structure;
  const int judged = steps_of_verdict(structure, cycle.steps_per_period);
  if (cycle.cut_short || is_dear(judged * work_of_step(structure))) return found;
  Verdict verdict = examine(problem, correction.options, cycle);
  if (verdict.cut_short)
  {
    cycle.cut_short = true;
    fidelity.reason = format("the run was ended at %d steps a period", cycle.steps_per_period);
    return found;
  }
  refuse_repelling(verdict, problem.unstable.modes.size() - 1, cycle.outcome);
  cycle.multipliers = std::move(verdict.floquet.multipliers);
  fidelity.verdict_steps = judged;
  return found;
}

RelativeChange model_errors_of(const CycleCorrection& correction, const Orbit& orbit)
{
  const Flow flow{{}, correction.problem.sliding.structure.M, correction.problem.sliding.structure.K};
  Multisecant multisecant;
  estimate_remaining_change(orbit_problem(correction, flow, orbit.period), correction.options.shooting, multisecant,
                            orbit);
  return multisecant.remaining;
}

} // namespace squeal
