#include "squeal/cycle/fidelity.hpp"

#include "full_correction.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// The cycle by way of the reduced model. Returns why there is none, or nothing.
std::string find_by_reduced_model(ReducedSearch& search, LimitCycle& cycle)
{
  const CycleProblem& problem = search.problem;
  if (problem.unstable.modes.size() > 1)
    return "several modes are unstable: only the full model's shooting excites them all";
  ReducedCycle reduced;
  if (const std::string reason = find_first_reduced_cycle(search, reduced); !reason.empty()) return reason;
  const Preconditioner preconditioner = preconditioner_of(search.correction, search.model, problem.sliding.structure);
  const Owned<Vec> state = full_motion(search, reduced.state);
  check(VecAXPY(displacement(state), 1, problem.sliding.equilibrium.u));
  const ShootingStart start{problem.sliding.equilibrium.u, displacement(state), velocity(state), reduced.period};
  if (search.fidelity.asked != CycleModel::full)
    return correct_on_full_model(search, start, preconditioner, reduced, cycle);
  cycle = find_cycle_from(problem, search.options, start, preconditioner, 0);
  return {};
}

/// Why the cycle's own theta and steps a period would give misleading growth; empty if they would not.
std::string step_refusal_of(const CycleProblem& problem)
{
  const ComplexMode& mode = problem.unstable.modes.front();
  const double period = 1 / mode.frequency_hz();
  return step_refusal(problem.sliding.structure, &mode, problem.settings.theta,
                      period / problem.settings.steps_per_period, problem.step);
}

/// The cycle of the full model, from the estimate, with at least `steps` steps a period.
void find_by_full_model(const CycleProblem& problem, const CycleOptions& options, int steps, FittedCycle& result)
{
  const double clock = MPI_Wtime();
  Fidelity& fidelity = result.fidelity;
  fidelity.used = CycleModel::full; // of whose errors nothing is known
  fidelity.frequency_error = fidelity.energy_error = std::nan("");
  fidelity.step_frequency_error = fidelity.step_energy_error = std::nan("");
  CycleSettings refined = problem.settings;
  refined.steps_per_period = std::max(refined.steps_per_period, steps);
  const CycleProblem at_steps{problem.sliding, problem.linearised, problem.modes,         problem.unstable,
                              refined,         problem.step,       problem.modes_options, problem.probes};
  result.cycle = find_cycle_from_estimate(at_steps, options);
  fidelity.steps_per_period = refined.steps_per_period;
  fidelity.full_seconds += MPI_Wtime() - clock;
  fidelity.full_periods += result.cycle.convergence.periods;
}

/// The cycle on the model asked for, or on the full one where "auto" cannot do without it.
void find_on_model(const CycleProblem& problem, const CycleOptions& options, FittedCycle& result)
{
  Fidelity& fidelity = result.fidelity;
  const bool by_full_model = fidelity.asked == CycleModel::full;
  ReducedSearch search{problem, options, fidelity, problem.settings.steps_per_period};
  if (fidelity.asked == CycleModel::automatic) search.steps = std::min(64, search.steps);
  // a start need not be better; slow motions multiply its error
  search.tolerance = by_full_model ? 1e-3 : 3e-4 * fidelity.accuracy;
  if (!by_full_model || options.start == CycleStart::reduced_model)
  {
    fidelity.used = by_full_model ? CycleModel::full : CycleModel::reduced;
    fidelity.contact_tolerance = 1e-3 * fidelity.accuracy;
    fidelity.reason = find_by_reduced_model(search, result.cycle);
    if (fidelity.reason.empty()) return;
  }
  if (fidelity.asked == CycleModel::reduced)
  {
    result.cycle.outcome.kind = problem.unstable.modes.size() > 1 ? OutcomeKind::refused : OutcomeKind::not_converged;
    result.cycle.outcome.reason = fidelity.reason;
    return;
  }
  find_by_full_model(problem, options, search.steps, result);
}

} // namespace

FittedCycle find_fitted_cycle(const CycleProblem& problem, const FidelityRequest& request, const CycleOptions& options)
{
  declare_solver_options();
  FittedCycle result;
  if (const std::string refusal = step_refusal_of(problem); !refusal.empty())
  {
    result.cycle.outcome = {OutcomeKind::refused, refusal, 0, 0};
    return result;
  }
  result.fidelity.asked = request.model;
  result.fidelity.accuracy = request.accuracy;
  find_on_model(problem, options, result);
  const State& start = result.cycle.measured.start;
  const std::filesystem::path& file = problem.settings.save_state;
  if (!file.empty() && start.u.get()) write_state(start, problem.sliding.structure, file);
  return result;
}

} // namespace squeal
