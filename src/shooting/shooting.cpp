#include "squeal/shooting/shooting.hpp"

#include "squeal/base/constants.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/shooting/secants.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

// The paper's shooting on a subspace (src/README.md, section 6.4), unknowns y = (T, c) of x = x_k + E c. The anchor and
// f are those of the last Jacobian: the Newton correction is orthogonal to the flow where it starts. Everything is
// scaled by the fluctuation, so that y and R are of order one. With the paper's three shapes there are seven unknowns,
// all on rank 0. Newton is SNES's; GMRES solves for its steps by columns of the exact tangent.
//
// Caveat: a solution of the projected equations leaves a defect outside the subspace, which need not be small.

/// The data that PETSc's callbacks share.
struct SubspaceSystem
{
  const OrbitProblem& problem;
  const ShootingOptions& options;
  ConvergenceLog& log;
  const Orbit& start;
  const std::vector<Owned<Vec>>& base;
  std::vector<Owned<Vec>> image{}; // of the base, in the energy product
  Orbit orbit{};                   // evaluated last, at `at`
  std::vector<double> at{};
  Owned<Vec> anchor{}, phase{}; // phase: energy image of the unit flow
  std::exception_ptr failure{};
};

/// y = (T - its start, c) as every rank's, in units of the fluctuation.
std::vector<double> shared_entries(const SubspaceSystem& system, Vec y)
{
  const double scale = system.start.fluctuation;
  std::vector<double> result = all_entries(y);
  for (double& entry : result) entry *= scale;
  result.front() /= energy_norm(system.problem.flow, system.start.rate);
  return result;
}

/// Rows <first, x>, <e_i, z> over the fluctuation, as entries of R.
void set_rows(const SubspaceSystem& system, double first, Vec z, Vec R)
{
  std::vector<double> rows{first};
  for (const auto& image : system.image) check(VecDot(image, z, &rows.emplace_back()));
  set_all_entries(R, rows);
  check(VecScale(R, 1 / system.start.fluctuation));
}

/// E c
Owned<Vec> combination(const SubspaceSystem& system, const std::vector<double>& y)
{
  Owned<Vec> x = zeros_like(system.start.state);
  for (std::size_t i = 0; i < system.base.size(); ++i) check(VecAXPY(x, y[i + 1], system.base[i]));
  return x;
}

/// Makes `orbit` the one at y. Returns false where T has left its bounds.
bool evaluate_at(SubspaceSystem& system, Vec at)
{
  const std::vector<double> y = shared_entries(system, at);
  if (y == system.at) return true;
  const double period = system.start.period + y[0];
  if (!admissible_period(system.problem, period)) return false;
  const Owned<Vec> state = combination(system, y);
  check(VecAXPY(state, 1, system.start.state));
  system.orbit = evaluate(system.problem, system.log, state, period);
  system.at = y;
  return std::isfinite(system.orbit.residual);
}

void form_residual(SubspaceSystem& system, Vec y, Vec R)
{
  check(VecSet(R, 1e6)); // far outside: large enough for the line search to come back
  if (!evaluate_at(system, y)) return;
  double along = 0;
  if (system.phase.get())
  {
    const Owned<Vec> moved = copy_of(system.orbit.state);
    check(VecAXPY(moved, -1, system.anchor));
    along = dot(system.phase, moved);
  }
  set_rows(system, along, system.orbit.defect, R);
}

void form_jacobian(SubspaceSystem& system, Vec y)
{
  evaluate_at(system, y);
  const Flow& flow = system.problem.flow;
  const Orbit& orbit = system.orbit;
  flow.record_period(orbit.period, orbit.state, {});
  system.anchor = copy_of(orbit.state);
  system.phase = zeros_like(orbit.rate);
  energy_image(flow, orbit.rate, system.phase);
  check(VecScale(system.phase, 1 / energy_norm(flow, orbit.rate)));
}

void multiply_jacobian(SubspaceSystem& system, Vec in, Vec out)
{
  const std::vector<double> y = shared_entries(system, in);
  const Owned<Vec> x = combination(system, y), image = copy_of(x.get());
  const Vec column = image;
  system.problem.flow.apply_tangent(std::span(&column, 1));
  ++system.log.convergence.periods;
  check(VecAXPBYPCZ(image, -1, y[0], 1, x, system.orbit.rate));
  set_rows(system, dot(system.phase, x), image, out);
}

/// Adds a record and sets `reason`, besides the library's own reasons, in two cases. The iterate falls onto the
/// equilibrium, where any residual vanishes. What is left is outside the base, or hardly shrinks, and a full-space
/// finish follows.
void decide_convergence(SubspaceSystem& system, PetscInt iteration, PetscReal norm, SNESConvergedReason* reason)
{
  Convergence& convergence = system.log.convergence;
  const double projected = norm * system.start.fluctuation / system.orbit.fluctuation;
  const double before = iteration > 0 ? convergence.records.back().residual_full : HUGE_VAL;
  record(system.log, ShootingStage::subspace, system.orbit, static_cast<PetscInt>(system.base.size()) + 1, projected);
  convergence.residual_projected = projected;
  if (iteration > 0) ++convergence.iterations;
  if (*reason != SNES_CONVERGED_ITERATING) return;
  const double residual = system.orbit.residual;
  if (collapsing(system.problem, system.orbit))
    *reason = SNES_DIVERGED_DTOL;
  else if (convergence.periods >= system.options.max_periods)
    *reason = SNES_DIVERGED_FUNCTION_COUNT;
  else if (system.options.finish != Finish::none && (projected < 0.1 * residual || residual > 0.5 * before))
    *reason = SNES_CONVERGED_FNORM_RELATIVE;
}

PetscErrorCode residual_callback(SNES, Vec y, Vec R, void* context)
{
  SubspaceSystem& system = *static_cast<SubspaceSystem*>(context);
  return guarded(system.failure, [&] { form_residual(system, y, R); });
}

PetscErrorCode jacobian_callback(SNES, Vec y, Mat, Mat, void* context)
{
  SubspaceSystem& system = *static_cast<SubspaceSystem*>(context);
  return guarded(system.failure, [&] { form_jacobian(system, y); });
}

PetscErrorCode product_callback(Mat J, Vec x, Vec y)
{
  SubspaceSystem* system = nullptr;
  PetscCall(MatShellGetContext(J, &system));
  return guarded(system->failure, [&] { multiply_jacobian(*system, x, y); });
}

PetscErrorCode convergence_callback(SNES snes, PetscInt iteration, PetscReal step, PetscReal change, PetscReal norm,
                                    SNESConvergedReason* reason, void* context)
{
  SubspaceSystem& system = *static_cast<SubspaceSystem*>(context);
  PetscCall(SNESConvergedDefault(snes, iteration, step, change, norm, reason, nullptr));
  return guarded(system.failure, [&] { decide_convergence(system, iteration, norm, reason); });
}

/// The solver with its defaults and the user's options.
Owned<SNES> make_solver(MPI_Comm comm, PetscInt iterations, double tolerance)
{
  Owned<SNES> snes;
  check(SNESCreate(comm, snes.put()));
  check(SNESSetOptionsPrefix(snes, "cycle_"));
  check(SNESSetTolerances(snes, 0.1 * tolerance, 0, 0, iterations, 1000));
  check(SNESSetMaxLinearSolveFailures(snes, PETSC_MAX_INT)); // a base on a small interface is dependent
  KSP ksp = nullptr;
  PC pc = nullptr;
  check(SNESGetKSP(snes, &ksp));
  check(KSPSetType(ksp, KSPGMRES));
  check(KSPSetTolerances(ksp, 1e-8, PETSC_DEFAULT, PETSC_DEFAULT, 30));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCNONE));
  SNESLineSearch search = nullptr;
  check(SNESGetLineSearch(snes, &search));
  check(SNESLineSearchSetType(search, SNESLINESEARCHBT));
  check(SNESLineSearchSetTolerances(search, 1e-6, 0.5, 1e-8, 1e-15, 1e-8, 8)); // longest step: half the fluctuation
  check(SNESSetFromOptions(snes));
  return snes;
}

/// Damped Newton (options -cycle_snes_...) on T and the coordinates in the subspace of the shapes. Before a finish only
/// a better orbit is taken. One that falls onto the equilibrium never is: the projected residual can only be small
/// there.
Orbit shoot_on_shapes(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log, Orbit start,
                      const std::vector<Vec>& shapes)
{
  std::vector<Owned<Vec>> base;
  for (const Vec shape : shapes)
  {
    const Owned<Vec> none = zeros_like(shape), moved = state_of(shape, none), moving = state_of(none, shape);
    extend_base(problem.flow, options.rank_tolerance, base, moved);
    extend_base(problem.flow, options.rank_tolerance, base, moving);
  }
  SubspaceSystem system{problem, options, log, start, base, {}, copy_of(start), std::vector<double>(base.size() + 1)};
  for (const auto& member : base)
  {
    system.image.push_back(zeros_like(member));
    energy_image(problem.flow, member, system.image.back());
  }
  const MPI_Comm comm = comm_of(start.state);
  const PetscInt size = static_cast<PetscInt>(base.size()) + 1, mine = rank_of(comm) == 0 ? size : 0;
  Owned<Mat> J;
  Owned<Vec> y, R;
  check(MatCreateShell(comm, mine, mine, size, size, &system, J.put()));
  check(MatShellSetOperation(J, MATOP_MULT, reinterpret_cast<void (*)(void)>(product_callback)));
  check(MatCreateVecs(J, y.put(), R.put()));
  check(VecSet(y, 0));
  const Owned<SNES> snes = make_solver(comm, options.subspace_newtons, problem.tolerance);
  check(SNESSetFunction(snes, R, residual_callback, &system));
  check(SNESSetJacobian(snes, J, J, jacobian_callback, &system));
  check(SNESSetConvergenceTest(snes, convergence_callback, &system, nullptr));
  check_after_callbacks(SNESSolve(snes, nullptr, y), system.failure);
  evaluate_at(system, y);
  const Orbit& orbit = system.orbit;
  if (collapsing(problem, orbit) || !std::isfinite(orbit.residual)) return start;
  const bool taken = options.finish == Finish::none || orbit.residual < start.residual;
  return taken ? std::move(system.orbit) : std::move(start);
}

/// A search for an orbit that attracts.
struct Search
{
  const OrbitProblem& problem;
  const ShootingOptions& options;
  ConvergenceLog& log;
  const ShootingStart& start;
};

/// The result of shooting from one state.
struct Attempt
{
  StageResult found;
  double first_return = 0; // return residual where it started
  Verdict verdict{};       // of a converged orbit

  bool converged() const { return found.ending == StageEnding::converged; }
  bool repels() const { return converged() && verdict.repels(); }
  bool answers() const { return converged() && !verdict.repels() && !verdict.doubted; }
};

/// Whether shooting has found the orbit again. Each is known up to its residual, which slow motions multiply.
bool is_again(const Orbit& orbit, const Orbit& known)
{
  constexpr double of_period = 1e-4, of_fluctuation = 1e-2;
  return std::abs(orbit.period / known.period - 1) < of_period &&
         std::abs(orbit.fluctuation / known.fluctuation - 1) < of_fluctuation;
}

/// Whether the orbit is that of the start, whose rounds are known.
bool repeats_start(const Search& search, const Orbit& orbit)
{
  constexpr double of_period = 0.1; // far from half of it
  return search.start.is_cycle && std::abs(orbit.period / search.start.period - 1) < of_period;
}

/// Shoots from the end of the free motion. Where that leads to the `known` attempt's orbit again, its verdict stands.
Attempt attempt_from(const Search& search, const Orbit& free, const Attempt* known)
{
  const auto& [problem, options, log, start] = search;
  Orbit orbit = copy_of(free);
  const double first_return = return_residual(problem, free);
  if (slips_one_way(problem, free)) return {{std::move(orbit), StageEnding::slips}, first_return};
  if (orbit.residual > problem.tolerance && options.subspace_newtons > 0 && !start.shapes.empty())
    orbit = shoot_on_shapes(problem, options, log, std::move(orbit), start.shapes);
  Attempt attempt{shoot_once(problem, options, log, std::move(orbit)), first_return};
  if (!attempt.converged()) return attempt;
  const int rounds = repeats_start(search, attempt.found.orbit) ? start.rounds : 2;
  attempt.found = prefer_fewer_rounds(problem, options, log, rounds, std::move(attempt.found));
  if (known && known->converged() && is_again(attempt.found.orbit, known->found.orbit))
  {
    attempt.verdict.floquet.multipliers = known->verdict.floquet.multipliers;
    attempt.verdict.doubted = known->verdict.doubted;
  }
  else
    attempt.verdict = judge(problem, options, log, attempt.found.orbit);
  return attempt;
}

/// Whether the second attempt is worth more than the first.
bool better(const Attempt& first, const Attempt& second)
{
  if (first.converged() != second.converged()) return second.converged();
  return second.answers() || (!first.converged() && second.found.orbit.residual < first.found.orbit.residual);
}

/// Whether a motion beside an orbit that repels leaves it so slowly that the search cannot see where it goes. It leaves
/// from a tenth of the fluctuation to all of it. Where periods cost little it is searched all the same.
bool leaves_too_slowly(const Search& search, const Attempt& attempt, int done)
{
  const std::vector<std::complex<double>>& values = attempt.verdict.floquet.multipliers.values;
  const int left = search.options.free_periods - done;
  if (!attempt.repels() || values.empty() || !is_dear(search.problem.flow.work)) return false;
  return std::log(10) > left * std::log(std::max(std::abs(values.front()), 1.));
}

/// Goes on integrating for 20, 40, 80 … periods, and shoots again after each. It does so earlier where the motion
/// returns three times better than where the last attempt started. The motion goes on by itself; once, from beside an
/// orbit that repels. Sets `free` to where it ends.
Attempt search_on(const Search& search, Attempt best, int done, Orbit& free)
{
  const auto& [problem, options, log, start] = search;
  double last_return = best.first_return, side = 0; // side: of the orbit that repels; 0: none was left yet
  int collapses = 0;
  for (int count = 20; !best.answers(); count *= 2)
  {
    const auto left = std::min<long>(options.free_periods - done, options.max_periods - log.convergence.periods);
    if (left <= 0) break;
    Owned<Vec> state = copy_of(free.state.get());
    double period = free.period;
    check(VecAXPY(state, 1, free.defect));
    const bool other_side = side > 0 && collapses > 0; // it fell to rest on the one
    if (best.repels() && (side == 0 || other_side))
    {
      side = other_side ? -1 : 1;
      state = state_beside(problem, best.found.orbit, best.verdict.floquet.fastest.real,
                           0.1 * side); // far enough to leave it in a few periods
      period = best.found.orbit.period;
      collapses = 0;
    }
    const double before = free.fluctuation;
    const long periods = log.convergence.periods;
    free = integrate_free_periods(
        problem, log, state, period,
        {static_cast<int>(std::min<long>(count, left)), last_return / 3, static_cast<int>(left)});
    done += static_cast<int>(log.convergence.periods - periods);
    if (!std::isfinite(free.residual)) break;
    // A motion that decays below what limits it rests in the end; one that grows there is on its way.
    if (collapsing(problem, free))
    {
      if (free.fluctuation < before && ++collapses > 1) break;
      continue;
    }
    Attempt next = attempt_from(search, free, &best);
    last_return = next.first_return;
    if (better(best, next)) best = std::move(next);
  }
  return best;
}

/// How long the motion takes to leave, in a sentence that follows the reason.
std::string leaving_time(const Multipliers& multipliers, double period)
{
  const std::complex<double> fastest = multipliers.values.front();
  const double periods = 1 / std::log(std::abs(fastest));
  return format("; at %.4g Hz it grows e-fold in %.3g periods (%.2g s): a larger -cycle_free_periods follows it",
                std::abs(std::arg(fastest)) / (two_pi * period), periods, periods * period);
}

/// Names the slip of a free motion whose offsets do not come to rest: it walks, or its slip decays.
void note_slip(const std::vector<double>& slips, Outcome& outcome)
{
  constexpr double decayed = 0.5; // over the second half
  const double now = slips.back();
  const bool walks = now > decayed * slips[slips.size() / 2];
  if (walks) outcome.kind = OutcomeKind::not_periodic;
  outcome.reason = walks ? format("a joint walks by %.4g m a period", now)
                         : format("a joint still slips by %.2g m a period, less in each: a larger -cycle_free_periods "
                                  "follows it",
                                  now);
}

/// How the search for an orbit ended, in words.
Outcome outcome_of(const Convergence& convergence, StageEnding ending, double residual)
{
  Outcome outcome{OutcomeKind::not_converged, "", convergence.iterations, residual};
  switch (ending)
  {
  case StageEnding::converged:
    outcome.kind = OutcomeKind::converged;
    break;
  case StageEnding::stalled:
    outcome.reason = "full residual above the tolerance after " + std::to_string(convergence.periods) + " periods";
    break;
  case StageEnding::collapsed:
    outcome.kind = OutcomeKind::collapsed_to_equilibrium;
    outcome.reason = "the fluctuation fell below a tenth of the energy at the start and at the first event that limits "
                     "growth";
    break;
  case StageEnding::slips:
    outcome.reason = "an offset still slips one way after " + std::to_string(convergence.periods) + " periods";
    break;
  case StageEnding::period_left_range:
    outcome.kind = OutcomeKind::not_periodic;
    outcome.reason = "the period left the range between half and twice the first one";
    break;
  }
  return outcome;
}

} // namespace

void declare_solver_options(MPI_Comm comm)
{
  (void)make_solver(comm, 1, 0);
}

OrbitProblem problem_of(const Flow& flow, const Preconditioner& preconditioner, const ShootingStart& start,
                        double tolerance)
{
  const Owned<Vec> rest = zeros_like(start.equilibrium);
  return {flow, preconditioner, state_of(start.equilibrium, rest), start.period, tolerance, 0};
}

ShootingResult shoot(const Flow& flow, const Preconditioner& preconditioner, const ShootingStart& start,
                     const ShootingSettings& settings, const ShootingOptions& options)
{
  Progress progress(comm_of(start.u), settings.title, settings.free_periods + 60.);
  ConvergenceLog log{progress, settings.before};
  OrbitProblem problem = problem_of(flow, preconditioner, start, settings.tolerance);
  problem.target_error = settings.target_error;
  const Owned<Vec> first = state_of(start.u, start.v);
  Orbit free =
      integrate_free_periods(problem, log, first, start.period, {settings.free_periods, 0, options.free_periods});
  const int done = static_cast<int>(log.slips.size());
  // Below the first event nothing limits a motion; above it a start may be ten times too large and still find one.
  problem.least_fluctuation = std::min(free.fluctuation, start.first_event) * std::sqrt(0.1);
  const Search search{problem, options, log, start};
  Attempt found = attempt_from(search, free, nullptr);
  const bool slow = leaves_too_slowly(search, found, done);
  if (options.finish != Finish::none && settings.goes_on && !slow)
    found = search_on(search, std::move(found), done, free);
  const bool goes_on = !slow && std::isfinite(free.residual);
  StageEnding ending = found.found.ending;
  if (ending == StageEnding::collapsed) ending = StageEnding::stalled; // unless the free motion decays, too
  if (!found.converged() && goes_on && collapsing(problem, free)) ending = StageEnding::collapsed;

  ShootingResult result;
  result.outcome = outcome_of(log.convergence, ending, found.found.orbit.residual);
  if (!found.converged() && goes_on && slips_one_way(problem, free)) note_slip(log.slips, result.outcome);
  refuse_repelling(found.verdict, start.other_unstable, result.outcome);
  result.ending = found.found.ending;
  if (found.converged())
    result.remaining =
        settings.target_error > 0 ? found.found.remaining : remaining_change(problem, options, found.found.orbit);
  result.multipliers = std::move(found.verdict.floquet.multipliers);
  if (slow) result.outcome.reason += leaving_time(result.multipliers, found.found.orbit.period);
  result.orbit = std::move(found.found.orbit);
  if (goes_on) result.free = std::move(free);
  result.convergence = std::move(log.convergence);
  result.cut_short = found.verdict.cut_short;
  return result;
}

} // namespace squeal
