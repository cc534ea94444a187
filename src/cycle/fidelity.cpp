#include "squeal/cycle/fidelity.hpp"

#include "reduced_cycle.hpp"
#include "squeal/cycle/preconditioner.hpp"
#include "step_refinement.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

namespace squeal
{

namespace
{

constexpr int plain_steps = 100; // a period of a model that the scene names

/// What sets the number of steps a period.
enum class StepChoice
{
  given,       // the scene, or a plain number
  by_accuracy, // the accuracy that the scene asks for
};

/// Why theta and the steps a period would give misleading growth; empty if they would not.
std::string step_refusal_of(const CycleProblem& problem, int steps_per_period)
{
  const ComplexMode& mode = problem.unstable.modes.front();
  const double h = 1 / mode.frequency_hz() / steps_per_period, theta = problem.settings.theta;
  const std::string reason = step_refusal(&mode, theta, h, problem.step);
  return reason.empty() ? friction_refusal(problem.sliding, &mode, theta, h, problem.step, 1) : reason;
}

/// The reduced model's cycle itself, with its verdict and what one period of the full model says of it.
LimitCycle measured_on_full_model(const CycleCorrection& correction, const ShootingStart& start)
{
  CycleSettings settings = correction.problem.settings;
  CycleOptions options = correction.options;
  settings.tolerance = std::numeric_limits<double>::max(); // no correction follows
  options.shooting.finish = Finish::none;
  options.shooting.max_periods = 1; // nor a motion beside it, which would not begin beside a cycle of the full model
  LimitCycle cycle =
      find_cycle_from(with_settings(correction.problem, settings), options, start, &correction.preconditioner, 0);
  cycle.tolerance = 0;
  return cycle;
}

/// Notes the errors of a cycle whose steps are given.
void note_model_errors(const CycleCorrection& correction, FittedCycle& found)
{
  const RelativeChange errors = model_errors_of(correction, found.cycle.orbit);
  found.fidelity.frequency_error = errors.frequency;
  found.fidelity.energy_error = errors.energy;
}

/// The full model's cycle from the reduced model's, whose derivative is the preconditioner, and the finer steps that
/// the accuracy needs. It does not answer where that shooting left the reduced cycle.
FittedCycle correct_on_full_model(const ReducedSearch& search, const ReducedCycle& reduced, StepChoice steps)
{
  CycleProblem problem = search.problem;
  problem.reduced = &search.model;
  const Preconditioner preconditioner =
      preconditioner_of(search.correction, coordinates_in(search.model, problem.sliding.structure));
  const Owned<Vec> state = full_motion(search, reduced.state);
  check(VecAXPY(displacement(state), 1, problem.sliding.equilibrium.u));
  ShootingStart start{problem.sliding.equilibrium.u, displacement(state), velocity(state), reduced.period};
  start.is_cycle = true;
  const CycleCorrection correction{problem, search.options, preconditioner};
  FittedCycle found{{}, search.fidelity};
  LimitCycle& cycle = found.cycle;
  const bool asked = found.fidelity.asked == CycleModel::reduced;
  if (asked)
    cycle = measured_on_full_model(correction, start);
  else if (problem.resumed)
    cycle = find_cycle_from_resumed(problem, search.options, &preconditioner);
  else
    cycle = find_cycle_from(problem, search.options, start, &preconditioner, 0);
  found.fidelity.full_periods = cycle.convergence.periods;
  if (cycle.cut_short) return found;
  const OutcomeKind kind = cycle.outcome.kind;
  found.answers = asked || (kind != OutcomeKind::collapsed_to_equilibrium && kind != OutcomeKind::not_periodic);
  if (!found.answers) found.fidelity.reason = "the full model's shooting from the reduced model's cycle left it";
  if (kind == OutcomeKind::converged && steps == StepChoice::by_accuracy && !asked)
    return refine_steps(correction, std::move(found));
  if (asked || kind == OutcomeKind::converged) note_model_errors(correction, found); // else the free motion went on
  return found;
}

constexpr const char* several_modes = "several modes are unstable: only the full model's shooting excites them all";

/// No cycle of the reduced model, for a reason: the full model follows unless the reduced one was asked for.
FittedCycle without_cycle(const ReducedSearch& search, const std::string& reason)
{
  FittedCycle none{{}, search.fidelity, search.fidelity.asked == CycleModel::reduced};
  none.fidelity.reason = reason;
  const bool several = search.problem.unstable.modes.size() > 1;
  none.cycle.outcome = {several ? OutcomeKind::refused : OutcomeKind::not_converged, reason, 0, 0};
  none.cycle.orbit.residual = std::nan(""); // no period of the full model was made
  return none;
}

/// The cycle by way of the reduced model's.
FittedCycle find_by_reduced_model(ReducedSearch& search, StepChoice steps)
{
  if (search.problem.unstable.modes.size() > 1) return without_cycle(search, several_modes);
  ReducedCycle reduced;
  if (const std::string reason = find_first_reduced_cycle(search, reduced); !reason.empty())
    return without_cycle(search, reason);
  const double clock = MPI_Wtime();
  FittedCycle found = correct_on_full_model(search, reduced, steps);
  found.fidelity.full_seconds += MPI_Wtime() - clock;
  search.fidelity = found.fidelity;
  if (!found.answers) return without_cycle(search, found.fidelity.reason);
  const bool converged =
      search.fidelity.asked == CycleModel::reduced || found.cycle.outcome.kind == OutcomeKind::converged;
  if (converged && steps == StepChoice::given && !found.cycle.cut_short) estimate_reduced_step_errors(search, reduced);
  found.fidelity = search.fidelity;
  return found;
}

/// The settings, with steps and tolerance where the scene leaves them open.
CycleSettings chosen_settings(const CycleProblem& problem, const FidelityRequest& request)
{
  CycleSettings settings = problem.settings;
  const bool chooses = request.model == CycleModel::automatic;
  if (settings.tolerance == 0) settings.tolerance = plain_tolerance;
  if (settings.steps_per_period > 0) return settings;
  const double turns = problem.given_period * problem.unstable.modes.front().frequency_hz(); // of the mode, if given
  settings.steps_per_period =
      (chooses ? request.begin_steps : plain_steps) * std::max(1, static_cast<int>(std::lround(turns)));
  if (chooses)
    settings.steps_per_period =
        permitted_steps(settings.steps_per_period, [&](int steps) { return !step_refusal_of(problem, steps).empty(); });
  return settings;
}

/// Lets `search` find the cycle with the chosen settings, unless these are refused. A cycle that answers is saved.
FittedCycle
find_fitted_cycle(const CycleProblem& given, const FidelityRequest& request, Fidelity fidelity,
                  const std::function<FittedCycle(const CycleProblem&, StepChoice, const Fidelity&)>& search)
{
  declare_solver_options(comm_of(given.sliding.structure.load));
  const CycleSettings settings = chosen_settings(given, request);
  const CycleProblem problem = with_settings(given, settings);
  if (const std::string refusal = step_refusal_of(problem, settings.steps_per_period); !refusal.empty())
  {
    FittedCycle refused;
    refused.cycle.outcome = {OutcomeKind::refused, refusal, 0, 0};
    return refused;
  }
  fidelity.asked = request.model;
  fidelity.accuracy = request.accuracy;
  if (request.model != CycleModel::full) fidelity.contact_tolerance = 1e-3 * request.accuracy;
  fidelity.verdict_steps = settings.steps_per_period;
  fidelity.chooses_steps = request.model == CycleModel::automatic && given.settings.steps_per_period == 0;
  FittedCycle result = search(problem, fidelity.chooses_steps ? StepChoice::by_accuracy : StepChoice::given, fidelity);
  if (!result.answers) return result;
  result.fidelity.steps_per_period = result.cycle.steps_per_period;
  const State& start = result.cycle.measured.start;
  const std::filesystem::path& file = settings.save_state;
  if (!file.empty() && start.u.get()) write_state(start, problem.sliding.structure, file);
  return result;
}

} // namespace

std::string no_reduced_search(const CycleProblem& problem)
{
  if (problem.unstable.modes.size() > 1) return several_modes;
  return problem.given_period > 0
             ? "the search starts from a cycle that is nearly known, which the full model takes up at once"
             : "";
}

FittedCycle find_on_reduced_model(const CycleProblem& given, const FidelityRequest& request,
                                  const CycleOptions& options)
{
  const auto search = [&](const CycleProblem& problem, StepChoice steps, const Fidelity& fidelity)
  {
    const bool asked = fidelity.asked == CycleModel::reduced;
    ReducedSearch reduced{problem, options, fidelity, problem.settings.steps_per_period};
    reduced.fidelity.used = CycleModel::reduced;
    reduced.tolerance = asked ? 3e-4 * fidelity.accuracy : 1e-3; // a start need not be better; slow motions multiply it
    try
    {
      return find_by_reduced_model(reduced, steps);
    }
    catch (const LibraryError&) // perhaps on this rank alone
    {
      throw;
    }
    catch (const Error& error) // on every rank alike: the reduced model is the same on all
    {
      if (asked) throw;
      return without_cycle(reduced, error.what());
    }
  };
  return find_fitted_cycle(given, request, {}, search);
}

FittedCycle find_on_full_model(const CycleProblem& given, const FidelityRequest& request, const CycleOptions& options,
                               const Fidelity& tried)
{
  const auto search = [&](const CycleProblem& problem, StepChoice steps, const Fidelity& fidelity)
  {
    const double clock = MPI_Wtime();
    FittedCycle found{find_cycle_from_start(problem, options), fidelity};
    found.fidelity.used = CycleModel::full;
    found.cycle.convergence.periods += fidelity.full_periods; // of a search that stalled
    found.fidelity.full_periods = found.cycle.convergence.periods;
    if (steps == StepChoice::by_accuracy && !found.cycle.cut_short &&
        found.cycle.outcome.kind == OutcomeKind::converged)
    {
      PeriodMap map{problem.sliding, problem.step, found.cycle.steps_per_period, found.cycle.theta};
      map.reactions = problem.sliding.equilibrium.reactions;
      std::shared_ptr<const ReducedModel> kept;
      CycleProblem with_model = problem;
      const Preconditioner preconditioner = recorded_preconditioner(with_model, map, kept);
      record_period(map, found.cycle.orbit.period, found.cycle.orbit.state, {});
      found = refine_steps({with_model, options, preconditioner}, std::move(found));
    }
    found.fidelity.full_seconds += MPI_Wtime() - clock;
    return found;
  };
  return find_fitted_cycle(given, request, tried, search);
}

} // namespace squeal
