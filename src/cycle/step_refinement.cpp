#include "step_refinement.hpp"

#include "floquet.hpp"

#include "squeal/base/constants.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/cycle/cycle_checkpoint.hpp"
#include "squeal/shooting/multisecant.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
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

double largest_step_error(const Fidelity& fidelity)
{
  return std::max(fidelity.step_frequency_error, fidelity.step_energy_error);
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

/// The flow whose every period is measured, on contact as exact as the accuracy needs.
struct MeasuredFlow
{
  PeriodMap map;
  Recording recording{};
  MeasuredPeriod measured{}; // of the last period
  Flow flow{};
  std::optional<CycleKeeper> keeper{};
};

void measure(MeasuredFlow& flow, double period, Vec from, Vec end, Vec rate)
{
  flow.measured = measure_period(flow.map, flow.recording, period, from, rate);
  check(VecCopy(flow.measured.end.u, displacement(end)));
  check(VecCopy(flow.measured.end.v, velocity(end)));
}

void make_flow(const CycleCorrection& correction, MeasuredFlow& result)
{
  const CycleProblem& problem = correction.problem;
  result.map.reactions = problem.sliding.equilibrium.reactions;
  result.map.options.contact.tolerance =
      std::min(result.map.options.contact.tolerance, 1e-3 * correction.fidelity.accuracy);
  result.recording = {problem.probes, correction.options.samples};
  const auto integrate = [&result](double period, Vec from, Vec end, Vec rate)
  { measure(result, period, from, end, rate); };
  result.flow = {integrate, problem.sliding.structure.M, problem.sliding.structure.K};
  result.keeper.emplace(problem.sliding.structure).watch(result.flow);
}

/// The full model's iteration, from one number of steps a period to the next.
struct FullShooting
{
  const CycleCorrection& correction;
  const OrbitProblem& problem;
  ConvergenceLog& log;
  MeasuredFlow& flow;
  ShootingOptions options;
  Multisecant multisecant{};
  Orbit orbit{};

  CycleAtSteps cycle() const { return {flow.map.steps, orbit.period, flow.measured.mean_fluctuating_energy}; }
};

void restart(FullShooting& shooting, Vec state, double period, int steps)
{
  shooting.flow.map.steps = steps;
  shooting.orbit = evaluate(shooting.problem, shooting.log, state, period);
  record_full(shooting.log, ShootingStage::full_period, shooting.orbit);
}

/// Shoots until what further steps would change is below half of the accuracy, as two steps say: one alone may change
/// the energy by nothing by chance. Returns why it did not get there, or nothing.
std::string shoot_to_accuracy(FullShooting& shooting)
{
  shooting.multisecant.last_step = {HUGE_VAL, HUGE_VAL};
  shooting.multisecant.target_error = shooting.correction.fidelity.accuracy / 2;
  StageResult found =
      shoot_by_multisecant(shooting.problem, shooting.options, shooting.log, shooting.multisecant, shooting.orbit);
  shooting.orbit = std::move(found.orbit);
  if (found.ending == StageEnding::converged) return {};
  return "the accuracy was not reached in " + std::to_string(shooting.log.convergence.periods) +
         " periods of the full model at more steps a period";
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

/// Appends the cycle at so many steps a period. `beyond`: how far past the last cycle its start is foretold, on the
/// line from the one before it. Returns why there is none, or nothing.
using AppendCycle = std::function<std::string(std::vector<CycleAtSteps>& cycles, int steps, double beyond)>;

/// The last cycle on a grid of time that begins half a step later; nothing where none is found.
using MoveGrid = std::function<std::optional<CycleAtSteps>()>;

/// Raises the errors to what the place of contact's events in their steps changes. Returns the larger change.
double raise_step_errors(Fidelity& fidelity, const CycleAtSteps& cycle, const CycleAtSteps& moved)
{
  const double of_period = std::abs(moved.period / cycle.period - 1),
               of_energy = std::abs(moved.energy / cycle.energy - 1);
  fidelity.step_frequency_error = std::max(fidelity.step_frequency_error, of_period);
  fidelity.step_energy_error = std::max(fidelity.step_energy_error, of_energy);
  return std::max(of_period, of_energy);
}

/// From the cycle at few steps a period to twice as many and on. Where the cycles agree, so must the last one on a
/// moved grid, if there is one: those of several numbers of steps may agree by chance. Returns why the accuracy was not
/// reached, or nothing.
std::string refine(Fidelity& fidelity, const CycleAtSteps& coarse, const AppendCycle& append, const MoveGrid& move)
{
  std::vector<CycleAtSteps> cycles{coarse};
  if (const std::string problem = append(cycles, 2 * coarse.steps, 0); !problem.empty()) return problem;
  for (int tries = 0;; ++tries)
  {
    const int before = cycles[cycles.size() - 2].steps, now = cycles.back().steps;
    estimate_step_errors(fidelity, cycles);
    double of_grid = 0;
    if (move && largest_step_error(fidelity) <= fidelity.accuracy / 2)
      if (const auto moved = move()) of_grid = raise_step_errors(fidelity, cycles.back(), *moved);
    if (largest_step_error(fidelity) <= fidelity.accuracy / 2) return {};
    if (tries == 5) return "the accuracy needs more than " + std::to_string(now) + " steps a period";
    const StepError of_period = step_error(cycles, &CycleAtSteps::period, 2),
                    of_energy = step_error(cycles, &CycleAtSteps::energy, 2);
    const double needed =
        std::max({of_period.steps_for(fidelity.accuracy / 3), of_energy.steps_for(fidelity.accuracy / 3),
                  now * of_grid / (fidelity.accuracy / 3)}); // events have errors of first order
    const int steps = 4 * static_cast<int>(std::ceil(std::clamp(needed, 1.5 * now, 4. * now) / 4));
    const double order = of_energy.order(now),
                 beyond = error_fraction(before, now, now, order) - error_fraction(before, now, steps, order);
    if (const std::string problem = append(cycles, steps, beyond); !problem.empty()) return problem;
  }
}

/// What was done before comes first.
Convergence joined(Convergence before, const Convergence& after)
{
  for (NewtonRecord record : after.records)
  {
    record.periods += before.periods;
    before.records.push_back(record);
  }
  before.iterations += after.iterations;
  before.periods += after.periods;
  return before;
}

/// Unfinds a cycle that only its own steps know. The motion goes on at the finer ones, from beside it: on a cycle that
/// repels it would stay for hundreds of periods.
void leave(LimitCycle& cycle, int finer, Vec equilibrium, const std::string& reason)
{
  constexpr double smaller = 0.9; // than the cycle, about the equilibrium: contact opens no further
  cycle.outcome.kind = OutcomeKind::not_converged;
  cycle.outcome.reason =
      format("a cycle at %d steps a period that finer ones do not know: ", cycle.steps_per_period) + reason;
  cycle.free = copy_of(cycle.orbit);
  check(VecScale(cycle.free.state, smaller));
  check(VecAXPY(displacement(cycle.free.state), 1 - smaller, equilibrium));
  cycle.steps_per_period = finer;
  cycle.multipliers = {};
}

/// Newton's start at a state beside a cycle, and options that end it soon: it takes three to six periods.
struct StartBesideCycle
{
  ShootingStart start;
  CycleOptions options;
};

StartBesideCycle start_beside_cycle(const CycleCorrection& correction, Vec u, Vec v, double period)
{
  StartBesideCycle beside{{correction.problem.sliding.equilibrium.u, u, v, period}, correction.options};
  beside.start.is_cycle = true;
  beside.options.shooting.free_periods = 0;
  beside.options.shooting.max_periods = 20;
  return beside;
}

/// The cycle of a small model on a grid that begins half a step later. What is found joins `convergence`.
std::optional<CycleAtSteps> find_on_moved_grid(const CycleCorrection& correction, LimitCycle& cycle)
{
  const CycleProblem& problem = correction.problem;
  CycleSettings settings = problem.settings;
  settings.steps_per_period = cycle.steps_per_period;
  PeriodMap map{problem.sliding, problem.step, cycle.steps_per_period, cycle.theta};
  set_period(map, cycle.orbit.period);
  const Vec state = cycle.orbit.state;
  State later{copy_of(displacement(state)), copy_of(velocity(state)), 0, problem.sliding.equilibrium.reactions};
  move_by_part(map, 0.5, later);
  StartBesideCycle beside = start_beside_cycle(correction, later.u, later.v, cycle.orbit.period);
  beside.options.shooting.multipliers = 0;
  LimitCycle moved =
      find_cycle_from(with_settings(problem, settings), beside.options, beside.start, correction.preconditioner, 0);
  cycle.convergence = joined(std::move(cycle.convergence), moved.convergence);
  if (moved.outcome.kind != OutcomeKind::converged) return {};
  return CycleAtSteps{cycle.steps_per_period, moved.orbit.period, moved.measured.mean_fluctuating_energy};
}

/// The cycle of a small model at so many steps a period, with its verdict, from the cycle at hand. Where that begins at
/// an event of contact Newton may fail: then from the scene's start, as if the scene gave the steps. The cycle at hand
/// stays where none is found. Returns why the refinement ends there, or nothing.
std::string find_anew(const CycleCorrection& correction, int steps, LimitCycle& cycle)
{
  const CycleProblem& problem = correction.problem;
  CycleSettings settings = problem.settings;
  settings.steps_per_period = steps;
  const Vec state = cycle.orbit.state;
  StartBesideCycle beside = start_beside_cycle(correction, displacement(state), velocity(state), cycle.orbit.period);
  beside.start.other_unstable = other_unstable_states(problem);
  CycleProblem finer = with_settings(problem, settings);
  finer.resumed = nullptr; // which led to the cycle at hand
  LimitCycle next = find_cycle_from(finer, beside.options, beside.start, correction.preconditioner, 0);
  if (next.outcome.kind != OutcomeKind::converged)
  {
    Convergence before = std::move(next.convergence);
    next = find_cycle_from_start(finer, correction.options);
    next.convergence = joined(std::move(before), next.convergence);
  }
  if (next.cut_short) throw Interrupted{}; // the cycle at hand has a verdict
  next.convergence = joined(std::move(cycle.convergence), next.convergence);
  const OutcomeKind kind = next.outcome.kind;
  if (kind != OutcomeKind::converged && kind != OutcomeKind::unstable_cycle)
  {
    cycle.convergence = std::move(next.convergence);
    return format("at %d steps a period no cycle was found: %s", steps, next.outcome.reason.c_str());
  }
  cycle = std::move(next);
  correction.fidelity.verdict_steps = steps;
  return kind == OutcomeKind::converged ? "" : format("at %d steps a period the cycle repels", steps);
}

/// A small model's cycle is found anew at each number of steps: Newton on its whole tangent takes a few periods.
/// Secants may leave a cycle whose contacts hit and stick.
void refine_small(const CycleCorrection& correction, LimitCycle& cycle)
{
  Fidelity& fidelity = correction.fidelity;
  const auto at_hand = [&] {
    return CycleAtSteps{cycle.steps_per_period, cycle.orbit.period, cycle.measured.mean_fluctuating_energy};
  };
  const auto append = [&](std::vector<CycleAtSteps>& cycles, int steps, double /*beyond*/)
  {
    std::string problem = find_anew(correction, steps, cycle);
    const bool found = problem.empty() || cycle.steps_per_period == steps;
    if (!found && cycles.size() == 1) leave(cycle, steps, correction.problem.sliding.equilibrium.u, problem);
    if (problem.empty()) cycles.push_back(at_hand());
    return problem;
  };
  const auto move = [&] { return find_on_moved_grid(correction, cycle); };
  if (const std::string problem = refine(fidelity, at_hand(), append, move); !problem.empty())
    fidelity.reason = problem;
  if (cycle.outcome.kind == OutcomeKind::converged) estimate_model_errors(correction, cycle);
  fidelity.full_periods = cycle.convergence.periods;
}

/// The verdict at the finer steps: impacts may make a cycle repel that attracts at few. Of a large model that would
/// take longer than the cycle; there the bars hold what twice as many steps change.
void examine_refined(const CycleCorrection& correction, const PeriodMap& map, LimitCycle& cycle)
{
  const CycleProblem& problem = correction.problem;
  FloquetAnalysis found = examine(problem, correction.options, map, cycle.orbit);
  cycle.multipliers = std::move(found.multipliers);
  correction.fidelity.verdict_steps = std::min(map.steps, enough_steps);
  refuse_repelling(cycle.multipliers, problem.unstable.modes.size() - 1, cycle.outcome);
}

/// Of no tolerance: the accuracy ends the iteration.
OrbitProblem orbit_problem(const CycleCorrection& correction, const Flow& flow, double period)
{
  const Vec u0 = correction.problem.sliding.equilibrium.u;
  return problem_of(flow, correction.preconditioner, {u0, nullptr, nullptr, period}, 0);
}

void note_model_errors(Fidelity& fidelity, const Multisecant& multisecant)
{
  fidelity.frequency_error = multisecant.remaining.frequency;
  fidelity.energy_error = multisecant.remaining.energy;
}

} // namespace

void estimate_step_errors(Fidelity& fidelity, const std::vector<CycleAtSteps>& cycles)
{
  const int steps = cycles.back().steps;
  fidelity.step_frequency_error = step_error(cycles, &CycleAtSteps::period, 1).at(steps);
  fidelity.step_energy_error = step_error(cycles, &CycleAtSteps::energy, 1).at(steps);
}

void refine_steps(const CycleCorrection& correction, LimitCycle& cycle)
{
  Fidelity& fidelity = correction.fidelity;
  if (cycle.outcome.kind != OutcomeKind::converged) return;
  const CycleProblem& problem = correction.problem;
  if (dofs_of(cycle.orbit.state) <= small_model) return refine_small(correction, cycle);
  MeasuredFlow flow{{problem.sliding, problem.step, cycle.steps_per_period, problem.settings.theta}};
  make_flow(correction, flow);
  Progress progress(comm_of(problem.sliding.structure.load), "cycle, finer steps", 20);
  ConvergenceLog log{progress, cycle.convergence}; // which stays where the run is asked to end
  const OrbitProblem orbit = orbit_problem(correction, flow.flow, cycle.orbit.period);
  FullShooting shooting{correction, orbit, log, flow, correction.options.shooting};
  shooting.options.max_periods = log.convergence.periods + most_corrections;
  shooting.orbit = copy_of(cycle.orbit);
  Orbit last = copy_of(shooting.orbit);
  const auto append = [&](std::vector<CycleAtSteps>& cycles, int steps, double beyond)
  {
    std::string problem_met = shoot_extrapolated(shooting, last, beyond, steps);
    if (problem_met.empty()) cycles.push_back(shooting.cycle());
    return problem_met;
  };
  const std::string problem_met = refine(
      fidelity, {cycle.steps_per_period, cycle.orbit.period, cycle.measured.mean_fluctuating_energy}, append, {});
  if (!problem_met.empty()) fidelity.reason = problem_met;
  note_model_errors(fidelity, shooting.multisecant);
  cycle.convergence = std::move(log.convergence);
  fidelity.full_periods = cycle.convergence.periods;
  cycle.tolerance = 0;
  cycle.outcome.residual = shooting.orbit.residual;
  cycle.steps_per_period = flow.map.steps;
  cycle.orbit = std::move(shooting.orbit);
  cycle.measured = std::move(flow.measured);
  cycle.costs = {flow.map.step.factor_seconds, flow.map.step.condensed_seconds};
  if (!is_large(problem.sliding.structure)) examine_refined(correction, flow.map, cycle);
}

void estimate_model_errors(const CycleCorrection& correction, const LimitCycle& cycle)
{
  const Flow flow{{}, correction.problem.sliding.structure.M, correction.problem.sliding.structure.K};
  const OrbitProblem orbit = orbit_problem(correction, flow, cycle.orbit.period);
  Multisecant multisecant;
  estimate_remaining_change(orbit, correction.options.shooting, multisecant, cycle.orbit);
  note_model_errors(correction.fidelity, multisecant);
}

LimitCycle measure_reduced_cycle(const CycleCorrection& correction, const ShootingStart& start)
{
  const CycleProblem& problem = correction.problem;
  MeasuredFlow flow{{problem.sliding, problem.step, problem.settings.steps_per_period, problem.settings.theta}};
  make_flow(correction, flow);
  Progress progress(comm_of(start.u), "cycle", 1);
  ConvergenceLog log{progress};
  const OrbitProblem orbit = orbit_problem(correction, flow.flow, start.period);
  const Owned<Vec> first = state_of(start.u, start.v);
  LimitCycle cycle;
  cycle.orbit = evaluate(orbit, log, first, start.period);
  record_full(log, ShootingStage::full_period, cycle.orbit);
  estimate_model_errors(correction, cycle);
  cycle.outcome = {OutcomeKind::converged, "", 0, cycle.orbit.residual};
  try
  {
    cycle.multipliers = examine(problem, correction.options, flow.map, cycle.orbit).multipliers;
  }
  catch (const Interrupted&) // on all ranks alike: the cycle stays
  {
    cycle.cut_short = true;
    cycle.multipliers.stability = Stability::undecided;
    cycle.multipliers.would_decide = "the run was ended while its multipliers were sought";
  }
  refuse_repelling(cycle.multipliers, problem.unstable.modes.size() - 1, cycle.outcome);
  cycle.steps_per_period = flow.map.steps;
  cycle.theta = flow.map.theta;
  cycle.convergence = std::move(log.convergence);
  correction.fidelity.full_periods = cycle.convergence.periods;
  const Finally last_period = undisturbed();
  cycle.measured = std::move(flow.measured);
  cycle.costs = {flow.map.step.factor_seconds, flow.map.step.condensed_seconds};
  return cycle;
}

} // namespace squeal
