#include "squeal/cycle/fidelity.hpp"

#include "preconditioner.hpp"
#include "reduced_cycle.hpp"
#include "step_refinement.hpp"

#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr int most_steps = 4096; // tried, until the growth at these is not misleading
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
  const std::string reason = step_refusal(problem.sliding.structure, &mode, theta, h, problem.step);
  return reason.empty() ? friction_refusal(problem.sliding, &mode, theta, h, problem.step, 1) : reason;
}

/// Refines the steps. Where the run is asked to end meanwhile, the cycle that was found stays.
void refine_or_cut_short(const CycleCorrection& correction, LimitCycle& cycle)
{
  try
  {
    refine_steps(correction, cycle);
  }
  catch (const Interrupted&) // on all ranks alike
  {
    cycle.cut_short = true;
    correction.fidelity.reason = format("the run was ended at %d steps a period", cycle.steps_per_period);
  }
}

/// The full model's cycle from the reduced model's, whose derivative is the preconditioner, and the finer steps that
/// the accuracy needs. Returns why there is none, or nothing.
std::string correct_on_full_model(ReducedSearch& search, const ReducedCycle& reduced, StepChoice steps,
                                  LimitCycle& cycle)
{
  const CycleProblem& problem = search.problem;
  const Preconditioner preconditioner =
      preconditioner_of(search.correction, coordinates_in(search.model, problem.sliding.structure));
  const Owned<Vec> state = full_motion(search, reduced.state);
  check(VecAXPY(displacement(state), 1, problem.sliding.equilibrium.u));
  ShootingStart start{problem.sliding.equilibrium.u, displacement(state), velocity(state), reduced.period};
  start.is_cycle = true;
  const CycleCorrection correction{problem, search.options, preconditioner, search.fidelity};
  if (search.fidelity.asked == CycleModel::reduced)
  {
    cycle = measure_reduced_cycle(correction, start);
    return {};
  }
  cycle = problem.resumed ? find_cycle_from_resumed(problem, search.options, preconditioner)
                          : find_cycle_from(problem, search.options, start, preconditioner, 0);
  search.fidelity.full_periods = cycle.convergence.periods;
  if (cycle.cut_short) return {};
  if (cycle.outcome.kind == OutcomeKind::collapsed_to_equilibrium || cycle.outcome.kind == OutcomeKind::not_periodic)
    return "the full model's shooting from the reduced model's cycle left it";
  if (cycle.outcome.kind != OutcomeKind::converged) return {}; // the free motion went on from there
  if (steps == StepChoice::by_accuracy)
    refine_or_cut_short(correction, cycle);
  else
    estimate_model_errors(correction, cycle);
  return {};
}

constexpr const char* several_modes = "several modes are unstable: only the full model's shooting excites them all";

/// The cycle by way of the reduced model's. Returns why there is none, or nothing.
std::string find_by_reduced_model(ReducedSearch& search, StepChoice steps, LimitCycle& cycle)
{
  if (search.problem.unstable.modes.size() > 1) return several_modes;
  ReducedCycle reduced;
  if (const std::string reason = find_first_reduced_cycle(search, reduced); !reason.empty()) return reason;
  const double clock = MPI_Wtime();
  const std::string reason = correct_on_full_model(search, reduced, steps, cycle);
  search.fidelity.full_seconds += MPI_Wtime() - clock;
  const bool converged = search.fidelity.asked == CycleModel::reduced || cycle.outcome.kind == OutcomeKind::converged;
  if (converged && steps == StepChoice::given && !cycle.cut_short) estimate_reduced_step_errors(search, reduced);
  return reason;
}

/// Lets `search` find the cycle with the chosen settings, unless these are refused. A cycle that answers is saved.
template <class Search> FittedCycle find_fitted_cycle(const CycleProblem& given, const FidelityRequest& request,
                                                      const Fidelity& tried, const Search& search)
{
  declare_solver_options(comm_of(given.sliding.structure.load));
  FittedCycle result;
  const CycleSettings settings = chosen_settings(given, request);
  const CycleProblem problem = with_settings(given, settings);
  if (const std::string refusal = step_refusal_of(problem, settings.steps_per_period); !refusal.empty())
  {
    result.cycle.outcome = {OutcomeKind::refused, refusal, 0, 0};
    return result;
  }
  Fidelity& fidelity = result.fidelity;
  fidelity = tried;
  fidelity.asked = request.model;
  fidelity.accuracy = request.accuracy;
  if (request.model != CycleModel::full) fidelity.contact_tolerance = 1e-3 * request.accuracy;
  fidelity.verdict_steps = settings.steps_per_period;
  const bool open = request.model == CycleModel::automatic && given.settings.steps_per_period == 0;
  search(problem, open ? StepChoice::by_accuracy : StepChoice::given, result);
  if (!result.answers) return result;
  fidelity.steps_per_period = result.cycle.steps_per_period;
  const State& start = result.cycle.measured.start;
  const std::filesystem::path& file = settings.save_state;
  if (!file.empty() && start.u.get()) write_state(start, problem.sliding.structure, file);
  return result;
}

} // namespace

CycleSettings chosen_settings(const CycleProblem& problem, const FidelityRequest& request)
{
  CycleSettings settings = problem.settings;
  const bool chooses = request.model == CycleModel::automatic;
  if (settings.tolerance == 0) settings.tolerance = plain_tolerance;
  if (settings.steps_per_period > 0) return settings;
  const double turns = problem.given_period * problem.unstable.modes.front().frequency_hz(); // of the mode, if given
  settings.steps_per_period =
      (chooses ? request.begin_steps : plain_steps) * std::max(1, static_cast<int>(std::lround(turns)));
  while (chooses && settings.steps_per_period < most_steps &&
         !step_refusal_of(problem, settings.steps_per_period).empty())
    settings.steps_per_period *= 2;
  return settings;
}

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
  const bool asked = request.model == CycleModel::reduced;
  const auto search = [&](const CycleProblem& problem, StepChoice steps, FittedCycle& result)
  {
    Fidelity& fidelity = result.fidelity;
    fidelity.used = CycleModel::reduced;
    ReducedSearch reduced{problem, options, fidelity, problem.settings.steps_per_period};
    reduced.tolerance = asked ? 3e-4 * fidelity.accuracy : 1e-3; // a start need not be better; slow motions multiply it
    try
    {
      fidelity.reason = find_by_reduced_model(reduced, steps, result.cycle);
    }
    catch (const LibraryError&) // perhaps on this rank alone
    {
      throw;
    }
    catch (const Error& error) // on every rank alike: the reduced model is the same on all
    {
      if (asked) throw;
      fidelity.reason = error.what();
    }
    if (fidelity.reason.empty()) return;
    result.answers = asked;
    result.cycle.outcome.kind = problem.unstable.modes.size() > 1 ? OutcomeKind::refused : OutcomeKind::not_converged;
    result.cycle.outcome.reason = fidelity.reason;
    result.cycle.orbit.residual = std::nan(""); // no period of the full model was made
  };
  return find_fitted_cycle(given, request, {}, search);
}

FittedCycle find_on_full_model(const CycleProblem& given, const FidelityRequest& request, const CycleOptions& options,
                               const Fidelity& tried)
{
  const auto search = [&](const CycleProblem& problem, StepChoice steps, FittedCycle& result)
  {
    const double clock = MPI_Wtime();
    Fidelity& fidelity = result.fidelity;
    fidelity.used = CycleModel::full;
    result.cycle = find_cycle_from_start(problem, options);
    result.cycle.convergence.periods += fidelity.full_periods; // of a search that stalled
    fidelity.full_periods = result.cycle.convergence.periods;
    if (steps == StepChoice::by_accuracy && !result.cycle.cut_short)
    {
      const Preconditioner preconditioner = estimated_preconditioner(problem, options.band_factor);
      refine_or_cut_short({problem, options, preconditioner, fidelity}, result.cycle);
    }
    fidelity.full_seconds += MPI_Wtime() - clock;
  };
  return find_fitted_cycle(given, request, tried, search);
}

} // namespace squeal
