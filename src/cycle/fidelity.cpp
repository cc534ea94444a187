#include "squeal/cycle/fidelity.hpp"

#include "reduced_cycle.hpp"
#include "step_refinement.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr int plain_steps = 100; // a period of a model that the scene names

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
  if (asked == CycleModel::automatic && problem.start && problem.start->period > 0)
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
  const double clock = MPI_Wtime();
  const Owned<Vec> state = copy_of(reduced.motion.get());
  check(VecAXPY(displacement(state), 1, problem.sliding.equilibrium.u));
  ShootingStart start{problem.sliding.equilibrium.u, displacement(state), velocity(state), reduced.period};
  start.is_cycle = true;
  LimitCycle& cycle = found.cycle;
  cycle = asked ? measured_on_full_model(problem, options, start)
                : find_cycle_from(problem, options, start, {problem.settings.tolerance});
  fidelity.full_periods = cycle.convergence.periods;
  fidelity.full_seconds += MPI_Wtime() - clock;
  if (cycle.cut_short) return {};
  const OutcomeKind kind = cycle.outcome.kind;
  if (!asked && (kind == OutcomeKind::collapsed_to_equilibrium || kind == OutcomeKind::not_periodic))
    return "the full model's shooting from the reduced model's cycle left it";
  if (!asked && kind != OutcomeKind::converged) return {}; // the free motion went on
  fidelity.frequency_error = cycle.remaining.frequency;
  fidelity.energy_error = cycle.remaining.energy;
  if (!fidelity.chooses_steps) estimate_reduced_step_errors(search, reduced);
  return {};
}

/// The same, where no reduced model can be made, too.
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
    const double clock = MPI_Wtime();
    const long before = fidelity.full_periods; // of a search that stalled
    cycle = find_cycle_from_start(problem, options);
    fidelity.full_periods = cycle.convergence.periods += before;
    fidelity.full_seconds += MPI_Wtime() - clock;
  }
  if (fidelity.chooses_steps && cycle.outcome.kind == OutcomeKind::converged && !cycle.cut_short)
  {
    const double clock = MPI_Wtime();
    refine_steps(problem, options, found);
    fidelity.full_seconds += MPI_Wtime() - clock;
  }
  fidelity.steps_per_period = cycle.steps_per_period;
  const State& start = cycle.measured.start;
  if (!settings.save_state.empty() && start.u.get()) write_state(start, problem.sliding.structure, settings.save_state);
  return found;
}

} // namespace squeal
