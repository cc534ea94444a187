#include "subspace_newton.hpp"

#include "squeal/base/callback.hpp"
#include "squeal/base/integers.hpp"

#include <cmath>
#include <Eigen/Dense>

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
  ShootingStage stage;
  std::vector<Owned<Vec>> base, image; // e_i and their energy images
  Owned<Vec> origin;
  double period = 0, period_scale = 0, scale = 0; // of the origin; of one unit of y_0; of one unit of y_i
  Orbit orbit;                                    // evaluated last, at `at`
  std::vector<double> at;
  Owned<Vec> anchor, phase; // phase: energy image of the unit flow
  std::exception_ptr failure;

  PetscInt size() const { return static_cast<PetscInt>(base.size()) + 1; }
};

std::vector<double> entries_of(const SubspaceSystem& system, Vec y)
{
  const double* entries = nullptr;
  PetscInt size = 0;
  check(VecGetSize(y, &size));
  check(VecGetArrayRead(y, &entries));
  std::vector<double> result(entries, entries + size);
  check(VecRestoreArrayRead(y, &entries));
  // all ranks go the same way in the solver only if they hold the same bits
  MPI_Bcast(result.data(), to_int(size), MPI_DOUBLE, 0, comm_of(system.origin));
  return result;
}

/// Makes `orbit` the one at y. Returns false when T has left its bounds.
bool evaluate_at(SubspaceSystem& system, const std::vector<double>& y)
{
  if (y == system.at) return true;
  const double period = system.period + y[0] * system.period_scale;
  if (!admissible_period(system.problem, period)) return false;
  const Owned<Vec> state = copy_of(system.origin);
  for (std::size_t i = 0; i < system.base.size(); ++i) check(VecAXPY(state, y[i + 1] * system.scale, system.base[i]));
  system.orbit = evaluate(system.problem, system.log, state, period);
  system.at = y;
  return std::isfinite(system.orbit.residual);
}

/// <e_i, x>
std::vector<double> projections(const SubspaceSystem& system, Vec x)
{
  std::vector<double> result;
  for (const auto& image : system.image) check(VecDot(image, x, &result.emplace_back()));
  return result;
}

void form_residual(SubspaceSystem& system, Vec y, Vec R)
{
  // far outside: large enough for the line search to come back
  check(VecSet(R, 1e6));
  if (!evaluate_at(system, entries_of(system, y))) return;
  std::vector<double> rows = projections(system, system.orbit.defect);
  double along = 0;
  if (system.phase.get())
  {
    const Owned<Vec> moved = copy_of(system.orbit.state);
    check(VecAXPY(moved, -1, system.anchor));
    check(VecDot(system.phase, moved, &along));
  }
  rows.insert(rows.begin(), along);
  MPI_Bcast(rows.data(), to_int(rows.size()), MPI_DOUBLE, 0, comm_of(system.origin));
  for (PetscInt i = 0; i < system.size(); ++i)
    check(VecSetValue(R, i, rows[static_cast<std::size_t>(i)] / system.scale, INSERT_VALUES));
  check(VecAssemblyBegin(R));
  check(VecAssemblyEnd(R));
}

/// The columns are independent trajectories of one step size.
void integrate_all(const Flow& flow, double period, const std::vector<Owned<Vec>>& starts,
                   const std::vector<Owned<Vec>>& ends)
{
  if (flow.integrate_many)
  {
    const std::vector<Vec> from(starts.begin(), starts.end()), to(ends.begin(), ends.end());
    flow.integrate_many(period, from, to);
    return;
  }
  for (std::size_t i = 0; i < starts.size(); ++i) flow.integrate(period, starts[i], ends[i], nullptr);
}

void set_column(const SubspaceSystem& system, Mat J, PetscInt column, double first, const std::vector<double>& rest,
                double factor)
{
  std::vector<double> rows = {first};
  for (const double value : rest) rows.push_back(value * factor);
  MPI_Bcast(rows.data(), to_int(rows.size()), MPI_DOUBLE, 0, comm_of(system.origin));
  for (std::size_t i = 0; i < rows.size(); ++i)
    check(MatSetValue(J, static_cast<PetscInt>(i), column, rows[i], INSERT_VALUES));
}

void form_jacobian(SubspaceSystem& system, Vec y, Mat J)
{
  evaluate_at(system, entries_of(system, y));
  const Flow& flow = system.problem.flow;
  const Orbit& orbit = system.orbit;
  system.anchor = copy_of(orbit.state);
  system.phase = zeros_like(orbit.rate);
  energy_image(flow, orbit.rate, system.phase);
  check(VecScale(system.phase, 1 / energy_norm(flow, orbit.rate)));
  set_column(system, J, 0, 0, projections(system, orbit.rate), system.period_scale / system.scale);
  const double step = system.options.difference * orbit.fluctuation;
  const Owned<Vec> base = base_of_differences(system.problem, system.log, orbit);
  std::vector<Owned<Vec>> moved, ends;
  for (const auto& member : system.base)
  {
    moved.push_back(copy_of(orbit.state));
    check(VecAXPY(moved.back(), step, member));
    ends.push_back(zeros_like(orbit.state));
  }
  integrate_all(flow, orbit.period, moved, ends);
  system.log.convergence.periods += static_cast<long>(ends.size());
  for (std::size_t i = 0; i < ends.size(); ++i)
  {
    check(VecAXPY(ends[i], -1, moved[i]));
    check(VecAXPY(ends[i], -1, base));
    double along = 0;
    check(VecDot(system.phase, system.base[i], &along));
    set_column(system, J, static_cast<PetscInt>(i) + 1, along, projections(system, ends[i]), 1 / step);
  }
  check(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
}

/// Least squares of least norm by singular values: a small interface makes the base, and the system, rank-deficient.
void solve_least_squares(Mat J, Vec b, Vec x, double rank_tolerance)
{
  PetscInt n = 0;
  check(VecGetSize(b, &n));
  const double *matrix = nullptr, *right = nullptr;
  double* result = nullptr;
  check(MatDenseGetArrayRead(J, &matrix));
  check(VecGetArrayRead(b, &right));
  check(VecGetArrayWrite(x, &result));
  Eigen::JacobiSVD<Eigen::MatrixXd> decomposition(Eigen::MatrixXd::Map(matrix, n, n),
                                                  Eigen::ComputeThinU | Eigen::ComputeThinV);
  decomposition.setThreshold(rank_tolerance);
  const Eigen::VectorXd solution = decomposition.solve(Eigen::VectorXd::Map(right, n));
  Eigen::VectorXd::Map(result, n) = solution;
  check(VecRestoreArrayWrite(x, &result));
  check(VecRestoreArrayRead(b, &right));
  check(MatDenseRestoreArrayRead(J, &matrix));
  if (!solution.allFinite()) throw Error("shooting: the Jacobian on the subspace is not finite");
}

/// Adds a record and sets `reason`, besides the library's own reasons, in two cases. The iterate falls onto the
/// equilibrium, where any residual vanishes. What is left is outside the base, or hardly shrinks, and a full-space
/// finish follows.
void decide_convergence(SubspaceSystem& system, PetscInt iteration, PetscReal norm, SNESConvergedReason* reason)
{
  Convergence& convergence = system.log.convergence;
  const double projected = norm * system.scale / system.orbit.fluctuation;
  const double before = iteration > 0 ? convergence.records.back().residual_full : HUGE_VAL;
  record(system.log, system.stage, system.orbit, static_cast<int>(system.size()), projected);
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

PetscErrorCode jacobian_callback(SNES, Vec y, Mat J, Mat, void* context)
{
  SubspaceSystem& system = *static_cast<SubspaceSystem*>(context);
  return guarded(system.failure, [&] { form_jacobian(system, y, J); });
}

PetscErrorCode least_squares_callback(PC pc, Vec b, Vec x)
{
  SubspaceSystem* system = nullptr;
  PetscCall(PCShellGetContext(pc, &system));
  return guarded(system->failure,
                 [&]
                 {
                   Mat J = nullptr;
                   check(PCGetOperators(pc, &J, nullptr));
                   solve_least_squares(J, b, x, system->options.rank_tolerance);
                 });
}

PetscErrorCode convergence_callback(SNES snes, PetscInt iteration, PetscReal step, PetscReal change, PetscReal norm,
                                    SNESConvergedReason* reason, void* context)
{
  SubspaceSystem& system = *static_cast<SubspaceSystem*>(context);
  PetscCall(SNESConvergedDefault(snes, iteration, step, change, norm, reason, nullptr));
  return guarded(system.failure, [&] { decide_convergence(system, iteration, norm, reason); });
}

/// The solver with its defaults and the user's options.
Owned<SNES> make_solver(PetscInt iterations, double tolerance)
{
  Owned<SNES> snes;
  check(SNESCreate(PETSC_COMM_SELF, snes.put()));
  check(SNESSetOptionsPrefix(snes, "cycle_"));
  check(SNESSetTolerances(snes, 0.1 * tolerance, 0, 0, iterations, 1000));
  KSP ksp = nullptr;
  PC pc = nullptr;
  check(SNESGetKSP(snes, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCSHELL));
  SNESLineSearch search = nullptr;
  check(SNESGetLineSearch(snes, &search));
  check(SNESLineSearchSetType(search, SNESLINESEARCHBT));
  check(SNESLineSearchSetTolerances(search, 1e-6, 0.5, 1e-8, 1e-15, 1e-8, 8)); // longest step: half the fluctuation
  check(SNESSetFromOptions(snes));
  if (rank_of(PETSC_COMM_WORLD) > 0) check(SNESMonitorCancel(snes)); // every rank solves the same: one speaks
  return snes;
}

void set_callbacks(SNES snes, SubspaceSystem& system, Mat J, Vec R)
{
  check(SNESSetFunction(snes, R, residual_callback, &system));
  check(SNESSetJacobian(snes, J, J, jacobian_callback, &system));
  check(SNESSetConvergenceTest(snes, convergence_callback, &system, nullptr));
  KSP ksp = nullptr;
  PC pc = nullptr;
  PetscBool shell = PETSC_FALSE;
  check(SNESGetKSP(snes, &ksp));
  check(KSPGetPC(ksp, &pc));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCSHELL, &shell));
  if (!shell) return; // the user's choice
  check(PCShellSetContext(pc, &system));
  check(PCShellSetName(pc, "least squares by singular values"));
  check(PCShellSetApply(pc, least_squares_callback));
}

} // namespace

void declare_subspace_options()
{
  (void)make_solver(1, 0);
}

Orbit shoot_on_subspace(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                        const Orbit& start, const std::vector<Owned<Vec>>& base, ShootingStage stage)
{
  SubspaceSystem system{problem,           options,        log, stage, {}, {}, copy_of(start.state), start.period, 0,
                        start.fluctuation, copy_of(start), {},  {},    {}, {}};
  for (const auto& member : base)
  {
    system.base.push_back(copy_of(member));
    system.image.push_back(zeros_like(member));
    energy_image(problem.flow, member, system.image.back());
  }
  system.period_scale = start.fluctuation / energy_norm(problem.flow, start.rate);
  system.at.assign(base.size() + 1, 0.);
  Owned<Mat> J;
  Owned<Vec> y, R;
  check(MatCreateSeqDense(PETSC_COMM_SELF, system.size(), system.size(), nullptr, J.put()));
  check(MatCreateVecs(J, y.put(), R.put()));
  check(VecSet(y, 0));
  const Owned<SNES> snes =
      make_solver((options.subspace_newtons < 0 ? 10 : options.subspace_newtons), problem.tolerance);
  set_callbacks(snes, system, J, R);
  check_after_callbacks(SNESSolve(snes, nullptr, y), system.failure);
  evaluate_at(system, entries_of(system, y));
  return std::move(system.orbit);
}

} // namespace squeal
