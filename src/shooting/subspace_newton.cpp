#include "subspace_newton.hpp"

#include "squeal/base/petsc.hpp"
#include "squeal/shooting/shooting.hpp"

#include <cmath>

namespace squeal
{

namespace
{

/// What PETSc's callbacks share.
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

} // namespace

void declare_solver_options(MPI_Comm comm)
{
  (void)make_solver(comm, 1, 0);
}

Orbit shoot_on_subspace(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                        const Orbit& start, const std::vector<Owned<Vec>>& base)
{
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
  return std::move(system.orbit);
}

} // namespace squeal
