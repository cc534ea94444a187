/// The paper's reduced shooting, on any base: x = x_k + E c with E energy-orthonormal, unknowns y = (T, c),
///     R_0 = <f, x - anchor>,   R_i = <e_i, Phi_T(x) - x>,   i = 1 ... n.
/// f and the anchor are those of the last Jacobian: the Newton correction is orthogonal to the flow where it starts.
/// Everything is scaled by the fluctuation, so that y and R are of order one. The system is small, dense and held by
/// every rank; the flow underneath is collective.
#include "squeal/shooting/shooting.hpp"

#include <cmath>
#include <exception>
#include <petscblaslapack.h>

namespace squeal
{

void extend_base(const Shooting& shooting, std::vector<Owned<Vec>>& base, Vec candidate)
{
  const double length = energy_norm(shooting.flow, candidate);
  if (!(length > 0)) return;
  Owned<Vec> fresh = copy_of(candidate);
  for (int pass = 0; pass < 2; ++pass) // the second removes what rounding left
    for (const auto& member : base) check(VecAXPY(fresh, -energy_product(shooting.flow, member, fresh), member));
  const double left = energy_norm(shooting.flow, fresh);
  if (left < shooting.options.rank_tolerance * length) return;
  check(VecScale(fresh, 1 / left));
  base.push_back(std::move(fresh));
}

namespace
{

struct Reduced
{
  Shooting& shooting;
  std::vector<Owned<Vec>> base, image; // e_i and their energy images
  std::string stage;
  Owned<Vec> origin;
  double period = 0, period_scale = 0, scale = 0; // of the origin; of one unit of y_0, y_i
  Orbit orbit;                                    // evaluated last, at `at`
  std::vector<double> at;
  Owned<Vec> anchor, phase; // phase: energy image of the unit flow
  std::exception_ptr failure;

  PetscInt size() const { return static_cast<PetscInt>(base.size()) + 1; }
};

// PETSc calls back through C: an exception waits here until the solver has returned.
template <class Work> PetscErrorCode guarded(Reduced& reduced, Work work)
{
  try
  {
    work();
  }
  catch (...)
  {
    reduced.failure = std::current_exception();
    return PETSC_ERR_LIB;
  }
  return PETSC_SUCCESS;
}

std::vector<double> entries_of(const Reduced& reduced, Vec y)
{
  const double* entries = nullptr;
  PetscInt size = 0;
  check(VecGetSize(y, &size));
  check(VecGetArrayRead(y, &entries));
  std::vector<double> result(entries, entries + size);
  check(VecRestoreArrayRead(y, &entries));
  // all ranks go the same way in the solver only if they hold the same bits
  MPI_Bcast(result.data(), static_cast<int>(size), MPI_DOUBLE, 0, comm_of(reduced.origin));
  return result;
}

/// Makes `orbit` the one at y; false when T has left its bounds.
bool evaluate_at(Reduced& reduced, const std::vector<double>& y)
{
  if (y == reduced.at) return true;
  const double period = reduced.period + y[0] * reduced.period_scale;
  if (!admissible_period(reduced.shooting, period)) return false;
  const Owned<Vec> state = copy_of(reduced.origin);
  for (std::size_t i = 0; i < reduced.base.size(); ++i)
    check(VecAXPY(state, y[i + 1] * reduced.scale, reduced.base[i]));
  reduced.orbit = evaluate(reduced.shooting, state, period);
  reduced.at = y;
  return std::isfinite(reduced.orbit.residual);
}

std::vector<double> projections(const Reduced& reduced, Vec x)
{
  std::vector<double> result;
  for (const auto& image : reduced.image) check(VecDot(image, x, &result.emplace_back()));
  return result;
}

PetscErrorCode function(SNES, Vec y, Vec R, void* context)
{
  Reduced& reduced = *static_cast<Reduced*>(context);
  return guarded(reduced,
                 [&]
                 {
                   // far outside: large enough for the line search to come back
                   check(VecSet(R, 1e6));
                   if (!evaluate_at(reduced, entries_of(reduced, y))) return;
                   std::vector<double> rows = projections(reduced, reduced.orbit.defect);
                   double along = 0;
                   if (reduced.phase.get())
                   {
                     const Owned<Vec> moved = copy_of(reduced.orbit.state);
                     check(VecAXPY(moved, -1, reduced.anchor));
                     check(VecDot(reduced.phase, moved, &along));
                   }
                   rows.insert(rows.begin(), along);
                   MPI_Bcast(rows.data(), static_cast<int>(rows.size()), MPI_DOUBLE, 0, comm_of(reduced.origin));
                   for (PetscInt i = 0; i < reduced.size(); ++i)
                     check(VecSetValue(R, i, rows[static_cast<std::size_t>(i)] / reduced.scale, INSERT_VALUES));
                   check(VecAssemblyBegin(R));
                   check(VecAssemblyEnd(R));
                 });
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

void set_column(const Reduced& reduced, Mat J, PetscInt column, double first, const std::vector<double>& rest,
                double factor)
{
  std::vector<double> rows = {first};
  for (const double value : rest) rows.push_back(value * factor);
  MPI_Bcast(rows.data(), static_cast<int>(rows.size()), MPI_DOUBLE, 0, comm_of(reduced.origin));
  for (std::size_t i = 0; i < rows.size(); ++i)
    check(MatSetValue(J, static_cast<PetscInt>(i), column, rows[i], INSERT_VALUES));
}

PetscErrorCode jacobian(SNES, Vec y, Mat J, Mat, void* context)
{
  Reduced& reduced = *static_cast<Reduced*>(context);
  return guarded(reduced,
                 [&]
                 {
                   evaluate_at(reduced, entries_of(reduced, y));
                   const Flow& flow = reduced.shooting.flow;
                   const Orbit& orbit = reduced.orbit;
                   const double speed = energy_norm(flow, orbit.rate);
                   reduced.anchor = copy_of(orbit.state);
                   reduced.phase = zeros_like(orbit.rate);
                   energy_image(flow, orbit.rate, reduced.phase);
                   check(VecScale(reduced.phase, 1 / speed));
                   set_column(reduced, J, 0, 0, projections(reduced, orbit.rate), reduced.period_scale / reduced.scale);
                   const double step = reduced.shooting.options.difference * orbit.fluctuation;
                   std::vector<Owned<Vec>> moved, ends;
                   for (const auto& member : reduced.base)
                   {
                     moved.push_back(copy_of(orbit.state));
                     check(VecAXPY(moved.back(), step, member));
                     ends.push_back(zeros_like(orbit.state));
                   }
                   integrate_all(flow, orbit.period, moved, ends);
                   reduced.shooting.periods += static_cast<long>(ends.size());
                   for (std::size_t i = 0; i < ends.size(); ++i)
                   {
                     check(VecAXPY(ends[i], -1, moved[i]));
                     check(VecAXPY(ends[i], -1, orbit.defect));
                     double along = 0;
                     check(VecDot(reduced.phase, reduced.base[i], &along));
                     set_column(reduced, J, static_cast<PetscInt>(i) + 1, along, projections(reduced, ends[i]),
                                1 / step);
                   }
                   check(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
                   check(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
                 });
}

/// Least squares of least norm by singular values: a small interface makes the base, and the system, rank-deficient.
PetscErrorCode solve_least_squares(PC pc, Vec b, Vec x)
{
  Reduced* reduced = nullptr;
  PetscCall(PCShellGetContext(pc, &reduced));
  return guarded(*reduced,
                 [&]
                 {
                   Mat J = nullptr;
                   check(PCGetOperators(pc, &J, nullptr));
                   Owned<Mat> copy;
                   check(MatDuplicate(J, MAT_COPY_VALUES, copy.put()));
                   check(VecCopy(b, x));
                   const PetscBLASInt n = static_cast<PetscBLASInt>(reduced->size()), one = 1, work_size = 64 * n;
                   std::vector<double> singular(static_cast<std::size_t>(n)), work(static_cast<std::size_t>(work_size));
                   double rank_tolerance = reduced->shooting.options.rank_tolerance;
                   PetscBLASInt rank = 0, info = 0, size = n, nrhs = one, lwork = work_size;
                   double *matrix = nullptr, *rhs = nullptr;
                   check(MatDenseGetArray(copy, &matrix));
                   check(VecGetArray(x, &rhs));
                   LAPACKgelss_(&size, &size, &nrhs, matrix, &size, rhs, &size, singular.data(), &rank_tolerance, &rank,
                                work.data(), &lwork, &info);
                   check(VecRestoreArray(x, &rhs));
                   check(MatDenseRestoreArray(copy, &matrix));
                   if (info != 0) throw Error("cycle: the singular values of the reduced Jacobian did not converge");
                 });
}

/// Stops, besides the usual reasons, when the iterate falls onto the equilibrium (where any residual vanishes), and
/// when what is left lies outside the base, or hardly shrinks, and a full-space finish follows.
PetscErrorCode converged(SNES snes, PetscInt iteration, PetscReal step, PetscReal change, PetscReal norm,
                         SNESConvergedReason* reason, void* context)
{
  Reduced& reduced = *static_cast<Reduced*>(context);
  PetscCall(SNESConvergedDefault(snes, iteration, step, change, norm, reason, nullptr));
  return guarded(reduced,
                 [&]
                 {
                   Shooting& shooting = reduced.shooting;
                   const double projected = norm * reduced.scale / reduced.orbit.fluctuation;
                   const double before = iteration > 0 ? shooting.records.back().residual_full : HUGE_VAL;
                   record(shooting, reduced.stage, static_cast<int>(reduced.size()), projected, reduced.orbit);
                   shooting.residual_projected = projected;
                   if (iteration > 0) ++shooting.iterations;
                   if (*reason != SNES_CONVERGED_ITERATING) return;
                   if (vanishing(shooting, reduced.orbit))
                     *reason = SNES_DIVERGED_DTOL;
                   else if (shooting.periods >= shooting.options.max_periods)
                     *reason = SNES_DIVERGED_FUNCTION_COUNT;
                   else if (shooting.options.finish != "none" &&
                            (projected < 0.1 * reduced.orbit.residual || reduced.orbit.residual > 0.5 * before))
                     *reason = SNES_CONVERGED_FNORM_RELATIVE;
                 });
}

/// The solver with its defaults and the user's options.
Owned<SNES> make_solver(const ShootingOptions& options, double tolerance)
{
  Owned<SNES> snes;
  check(SNESCreate(PETSC_COMM_SELF, snes.put()));
  check(SNESSetOptionsPrefix(snes, "cycle_"));
  check(SNESSetTolerances(snes, 0.1 * tolerance, 0, 0, options.reduced_newtons, 1000));
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

void set_up(SNES snes, Reduced& reduced, Mat J, Vec R)
{
  check(SNESSetFunction(snes, R, function, &reduced));
  check(SNESSetJacobian(snes, J, J, jacobian, &reduced));
  check(SNESSetConvergenceTest(snes, converged, &reduced, nullptr));
  KSP ksp = nullptr;
  PC pc = nullptr;
  PetscBool standard = PETSC_FALSE;
  check(SNESGetKSP(snes, &ksp));
  check(KSPGetPC(ksp, &pc));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCSHELL, &standard));
  if (!standard) return; // the user's choice
  check(PCShellSetContext(pc, &reduced));
  check(PCShellSetName(pc, "least squares by singular values"));
  check(PCShellSetApply(pc, solve_least_squares));
}

} // namespace

void declare_reduced_options()
{
  (void)make_solver({}, 0);
}

Orbit shoot_reduced(Shooting& shooting, const Orbit& start, const std::vector<Owned<Vec>>& base,
                    const std::string& stage)
{
  Reduced reduced{shooting, {}, {}, stage, copy_of(start.state), start.period, 0, start.fluctuation, copy_of(start),
                  {},       {}, {}, {}};
  for (const auto& member : base)
  {
    reduced.base.push_back(copy_of(member));
    reduced.image.push_back(zeros_like(member));
    energy_image(shooting.flow, member, reduced.image.back());
  }
  reduced.period_scale = start.fluctuation / energy_norm(shooting.flow, start.rate);
  reduced.at.assign(base.size() + 1, 0.);
  Owned<Mat> J;
  Owned<Vec> y, R;
  check(MatCreateSeqDense(PETSC_COMM_SELF, reduced.size(), reduced.size(), nullptr, J.put()));
  check(MatCreateVecs(J, y.put(), R.put()));
  check(VecSet(y, 0));
  const Owned<SNES> snes = make_solver(shooting.options, shooting.tolerance);
  set_up(snes, reduced, J, R);
  const PetscErrorCode code = SNESSolve(snes, nullptr, y);
  if (reduced.failure) std::rethrow_exception(reduced.failure);
  check(code);
  evaluate_at(reduced, entries_of(reduced, y));
  return std::move(reduced.orbit);
}

} // namespace squeal
