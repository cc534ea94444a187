#include "squeal/cycle/fidelity.hpp"

#include "reduced_cycle.hpp"
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

constexpr int plain_steps = 100; // a period of a model that the scene names

constexpr int most_corrections = 60; // periods of the full model while the steps a period are refined

double largest(const RelativeChange& errors)
{
  return std::max(errors.frequency, errors.energy);
}

/// A cycle at some number of steps a period.
struct CycleAtSteps
{
  int steps = 0;
  double period = 0, energy = 0; // [s], [J]
};

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

/// Errors of the last of two cycles, of first order, or of the last of more, of the order that all of them show.
RelativeChange step_errors_of(const std::vector<CycleAtSteps>& cycles)
{
  return {step_error(cycles, &CycleAtSteps::period), step_error(cycles, &CycleAtSteps::energy)};
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

  /// Shoots until what further steps would change is below half of the accuracy. Where the steps are exact, below a
  /// twentieth unless that stalls, since cycles on two grids are compared.
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

  /// Whether a motion that starts on the cycle leaves it at `steps` steps a period. It then comes back less near than
  /// at first, and less near than motions beside a cycle are watched. Adds its periods.
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
/// moved grid: those of several numbers of steps may agree by chance. Where the iteration's steps are exact, the cycle
/// must exist at four times the steps a period, too: a coarse grid alone may hold one.
void refine(FineShooting& shooting, FittedCycle& found)
{
  constexpr int most_tries = 6;
  const double accuracy = shooting.accuracy;
  LimitCycle& cycle = found.cycle;
  std::vector<CycleAtSteps> cycles{at_steps(cycle)};
  bool accurate = false;
  for (int tries = 1, steps = 2 * cycle.steps_per_period;; ++tries)
  {
    LimitCycle finer = shooting.cycle_near(cycle.orbit.state, cycle.orbit.period, steps, cycle.convergence);
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
    const bool confirmed = accurate || !shooting.exact;
    const RelativeChange errors = step_errors_of(cycles);
    take(std::move(finer), errors, found);
    accurate = largest(errors) <= accuracy / 2;
    if (accurate && confirmed) return;
    if (tries >= most_tries && !accurate)
    {
      found.fidelity.reason = format("the accuracy needs more than %d steps a period", steps);
      return;
    }
    const double needed = steps * (accurate ? 4 : std::sqrt(largest(errors) / (accuracy / 3)));
    steps = 4 * static_cast<int>(std::ceil(std::clamp(needed, 1.5 * steps, 4. * steps) / 4));
  }
}

/// Notes that the end of the run cut the refinement short.
void cut_short(FittedCycle& found)
{
  found.cycle.cut_short = true;
  found.fidelity.reason = format("the run was ended at %d steps a period", found.cycle.steps_per_period);
}

/// Takes a converged cycle to twice as many steps a period. Where these are too few, to as many as the errors of both
/// foretell. Where the accuracy is not reached, the finest cycle stands with its errors, and its reason says so.
/// Where the run is asked to end meanwhile, the cycle that was found stays.
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

/// Why theta and the steps a period would give misleading growth; empty if they would not.
std::string step_refusal_of(const CycleProblem& problem, int steps_per_period)
{
  const ComplexMode& mode = problem.unstable.modes.front();
  const double h = 1 / mode.frequency_hz() / steps_per_period, theta = problem.settings.theta;
  const std::string reason = step_refusal(&mode, theta, h, problem.step);
  return reason.empty() ? friction_refusal(problem.sliding, &mode, theta, h, problem.step, 1) : reason;
}

/// The reduced model's cycle itself, with its verdict and what one period of the full model says of it.
LimitCycle measured_on_full_model(CycleProblem& problem, CycleOptions options, const ShootingStart& start)
{
  options.shooting.finish = Finish::none;
  options.shooting.max_periods = 1; // nor a motion beside it, which would not begin beside a cycle of the full model
  LimitCycle cycle =
      find_cycle_from(problem, options, start, {std::numeric_limits<double>::max()}); // no correction follows
  cycle.tolerance = 0;
  return cycle;
}

/// Why no reduced model leads to the cycle that is sought; empty if one may.
std::string no_reduced_search(const CycleProblem& problem, CycleModel asked)
{
  if (problem.unstable.modes.size() > 1)
    return "several modes are unstable: only the full model's shooting excites them all";
  if (asked == CycleModel::automatic && problem.start && problem.start->period > 0 && !problem.start->resumed)
    return "the search starts from a cycle that is nearly known, which the full model takes up at once";
  return {};
}

/// The cycle of the full model from the reduced model's, or that one itself where it was asked for. Returns why there
/// is none, or nothing.
std::string find_by_reduced_model(CycleProblem& problem, const CycleOptions& options, FittedCycle& found)
{
  Fidelity& fidelity = found.fidelity;
  const bool asked = fidelity.asked == CycleModel::reduced;
  if (const std::string reason = no_reduced_search(problem, fidelity.asked); !reason.empty()) return reason;
  fidelity.used = CycleModel::reduced;
  // a start need not be better than 1e-3; slow motions multiply it
  ReducedSearch search{problem, options, fidelity, asked ? 3e-4 * fidelity.accuracy : 1e-3};
  ReducedCycle reduced;
  if (const std::string reason = find_first_reduced_cycle(search, reduced); !reason.empty()) return reason;
  const Owned<Vec> state = copy_of(reduced.motion.get());
  check(VecAXPY(displacement(state), 1, problem.sliding.equilibrium.u));
  ShootingStart start{problem.sliding.equilibrium.u, displacement(state), velocity(state), reduced.period};
  if (const GivenStart& given = *problem.start; given.resumed && !asked)
    start = {problem.sliding.equilibrium.u, given.state.u, given.state.v, given.period};
  start.is_cycle = true;
  LimitCycle& cycle = found.cycle;
  cycle = asked ? measured_on_full_model(problem, options, start)
                : find_cycle_from(problem, options, start, {problem.settings.tolerance});
  fidelity.full_periods = cycle.convergence.periods;
  if (cycle.cut_short) return {};
  const OutcomeKind kind = cycle.outcome.kind;
  if (!asked && (kind == OutcomeKind::collapsed_to_equilibrium || kind == OutcomeKind::not_periodic))
    return "the full model's shooting from the reduced model's cycle left it";
  if (!asked && kind != OutcomeKind::converged) return {}; // the free motion went on
  fidelity.frequency_error = cycle.remaining.frequency;
  fidelity.energy_error = cycle.remaining.energy;
  if (!fidelity.chooses_steps)
  {
    const int steps = problem.settings.steps_per_period;
    const ReducedCycle twice = cycle_at_twice_the_steps(search, reduced);
    const RelativeChange errors =
        step_errors_of({{2 * steps, twice.period, twice.energy}, {steps, reduced.period, reduced.energy}});
    fidelity.step_frequency_error = twice.converged ? errors.frequency : std::nan("");
    fidelity.step_energy_error = twice.converged ? errors.energy : std::nan("");
  }
  return {};
}

/// Finds the cycle so; the sentence also says why no reduced model can be made.
std::string try_reduced_model(CycleProblem& problem, const CycleOptions& options, FittedCycle& found)
{
  try
  {
    return find_by_reduced_model(problem, options, found);
  }
  catch (const Error& error) // on every rank alike: the reduced model is the same on all
  {
    if (found.fidelity.asked == CycleModel::reduced) throw;
    return error.what();
  }
}

/// The settings, with steps and tolerance where the scene leaves them open.
CycleSettings chosen_settings(const CycleProblem& problem, const FidelityRequest& request)
{
  CycleSettings settings = problem.settings;
  const bool chooses = request.model == CycleModel::automatic;
  if (settings.tolerance == 0) settings.tolerance = plain_tolerance;
  if (settings.steps_per_period > 0) return settings;
  const double known = problem.start ? problem.start->period : 0,
               turns = known * problem.unstable.modes.front().frequency_hz(); // of the mode
  settings.steps_per_period =
      (chooses ? request.begin_steps : plain_steps) * std::max(1, static_cast<int>(std::lround(turns)));
  if (chooses)
    settings.steps_per_period =
        permitted_steps(settings.steps_per_period, [&](int steps) { return !step_refusal_of(problem, steps).empty(); });
  return settings;
}

/// The account of the search before it begins.
Fidelity begun(const CycleProblem& given, const FidelityRequest& request, int steps)
{
  Fidelity fidelity;
  fidelity.asked = request.model;
  fidelity.accuracy = request.accuracy;
  if (request.model != CycleModel::full) fidelity.contact_tolerance = 1e-3 * request.accuracy;
  fidelity.verdict_steps = steps;
  fidelity.chooses_steps = request.model == CycleModel::automatic && given.settings.steps_per_period == 0;
  return fidelity;
}

} // namespace

FittedCycle find_fitted_cycle(const CycleProblem& given, const FidelityRequest& request, const CycleOptions& options)
{
  declare_solver_options(comm_of(given.sliding.structure.load));
  CycleProblem problem = given;
  const CycleSettings& settings = problem.settings = chosen_settings(given, request);
  FittedCycle found;
  LimitCycle& cycle = found.cycle;
  if (const std::string refusal = step_refusal_of(problem, settings.steps_per_period); !refusal.empty())
  {
    cycle.outcome = {OutcomeKind::refused, refusal, 0, 0};
    return found;
  }
  Fidelity& fidelity = found.fidelity = begun(given, request, settings.steps_per_period);
  const bool on_full = request.model == CycleModel::full;
  if (!on_full) fidelity.reason = try_reduced_model(problem, options, found);
  if (!on_full && !fidelity.reason.empty())
  {
    const bool several = problem.unstable.modes.size() > 1;
    cycle = {};
    cycle.outcome = {several ? OutcomeKind::refused : OutcomeKind::not_converged, fidelity.reason, 0, 0};
    cycle.orbit.residual = std::nan(""); // no period of the full model was made
    if (request.model == CycleModel::reduced) return found;
    if (fidelity.used == CycleModel::reduced) found.on_reduced = cycle.outcome;
  }
  if (on_full || !fidelity.reason.empty())
  {
    problem.reduced.reset();
    fidelity.used = CycleModel::full;
    const long before = fidelity.full_periods; // of a search that stalled
    cycle = find_cycle_from_start(problem, options);
    fidelity.full_periods = cycle.convergence.periods += before;
  }
  if (fidelity.chooses_steps && cycle.outcome.kind == OutcomeKind::converged && !cycle.cut_short)
    refine_steps(problem, options, found);
  fidelity.steps_per_period = cycle.steps_per_period;
  if (cycle.multipliers.stability == Stability::stable && cycle.measured.stick_pairs_max > 0 &&
      any_law(problem.sliding.interface.friction, has_two_levels))
  {
    cycle.multipliers.stability = Stability::undecided;
    cycle.multipliers.would_decide = "friction that falls at once from rest is not seen by the tangent: [cycle] starts "
                                     "shows which motions attract";
  }
  const State& start = cycle.measured.start;
  if (!settings.save_state.empty() && start.u.get()) write_state(start, problem.sliding.structure, settings.save_state);
  return found;
}

} // namespace squeal
