/// Fallback of the finish: Newton with a line search on the bordered system, GMRES on directional differences,
/// preconditioned from the right by the sliding modes (options -cycle_full_snes_..., -cycle_full_ksp_...).
/// The unknown is one Vec z = (omega sqrt(m) u, sqrt(m) v, speed T) with m the diagonal of M: its plain norm, which
/// PETSc's solvers take, then stands for the energy norm. Convergence is judged in the energy norm itself.
#include "squeal/shooting/shooting.hpp"

#include <algorithm>
#include <cmath>
#include <exception>

namespace squeal
{

namespace
{

struct FullSpace
{
  Shooting& shooting;
  Owned<Vec> scale; // (omega sqrt(m), sqrt(m))
  double speed = 0;
  Orbit orbit; // evaluated last, at state `at`
  Owned<Vec> at, anchor;
  Border border;
  Orbit best;
  int vanished = 0; // points met whose fluctuation is next to nothing
  std::exception_ptr failure;
};

template <class Work> PetscErrorCode guarded(FullSpace& full, Work work)
{
  try
  {
    work();
  }
  catch (...)
  {
    full.failure = std::current_exception();
    return PETSC_ERR_LIB;
  }
  return PETSC_SUCCESS;
}

/// z = (scaled state, speed * border); the border lives on rank 0, after this rank's part of the state.
void pack(const FullSpace& full, Vec state, double border, Vec z)
{
  const Owned<Vec> scaled = zeros_like(state);
  check(VecPointwiseMult(displacement(scaled), displacement(full.scale), displacement(state)));
  check(VecPointwiseMult(velocity(scaled), velocity(full.scale), velocity(state)));
  double* to = nullptr;
  check(VecGetArray(z, &to));
  PetscInt offset = 0;
  for (const Vec part : {displacement(scaled), velocity(scaled)})
  {
    const double* from = nullptr;
    PetscInt size = 0;
    check(VecGetLocalSize(part, &size));
    check(VecGetArrayRead(part, &from));
    std::copy(from, from + size, to + offset);
    check(VecRestoreArrayRead(part, &from));
    offset += size;
  }
  if (rank_of(comm_of(z)) == 0) to[offset] = full.speed * border;
  check(VecRestoreArray(z, &to));
}

double unpack(const FullSpace& full, Vec z, Vec state)
{
  const double* from = nullptr;
  check(VecGetArrayRead(z, &from));
  PetscInt offset = 0;
  for (const Vec part : {displacement(state), velocity(state)})
  {
    double* to = nullptr;
    PetscInt size = 0;
    check(VecGetLocalSize(part, &size));
    check(VecGetArray(part, &to));
    std::copy(from + offset, from + offset + size, to);
    check(VecRestoreArray(part, &to));
    offset += size;
  }
  const MPI_Comm comm = comm_of(z);
  double border = rank_of(comm) == 0 ? from[offset] / full.speed : 0;
  MPI_Bcast(&border, 1, MPI_DOUBLE, 0, comm);
  check(VecRestoreArrayRead(z, &from));
  check(VecPointwiseDivide(displacement(state), displacement(state), displacement(full.scale)));
  check(VecPointwiseDivide(velocity(state), velocity(state), velocity(full.scale)));
  return border;
}

Owned<Vec> make_scale(const Shooting& shooting, double period)
{
  Owned<Vec> scale = zeros_like(shooting.equilibrium);
  const Vec mass = velocity(scale);
  double largest = 0;
  check(MatGetDiagonal(shooting.flow.M, mass));
  check(VecMax(mass, nullptr, &largest));
  // a motion with next to no mass still needs a scale
  const Owned<Vec> floor = zeros_like(mass);
  check(VecSet(floor, 1e-8 * largest));
  check(VecPointwiseMax(mass, mass, floor));
  check(VecSqrtAbs(mass));
  check(VecCopy(mass, displacement(scale)));
  check(VecScale(displacement(scale), 2 * PETSC_PI / period));
  return scale;
}

PetscErrorCode function(SNES, Vec z, Vec R, void* context)
{
  FullSpace& full = *static_cast<FullSpace*>(context);
  return guarded(full,
                 [&]
                 {
                   const Owned<Vec> state = zeros_like(full.orbit.state);
                   const double period = unpack(full, z, state);
                   check(VecSet(R, 1e6 * full.orbit.fluctuation)); // far outside: the line search comes back
                   if (!admissible_period(full.shooting, period)) return;
                   PetscBool same = PETSC_FALSE;
                   check(VecEqual(z, full.at, &same));
                   if (!same)
                   {
                     Orbit orbit = evaluate(full.shooting, state, period);
                     if (vanishing(full.shooting, orbit)) ++full.vanished;
                     if (!std::isfinite(orbit.residual) || vanishing(full.shooting, orbit)) return;
                     full.orbit = std::move(orbit);
                     check(VecCopy(z, full.at));
                     if (full.orbit.residual < full.best.residual) full.best = copy_of(full.orbit);
                   }
                   double along = 0;
                   const Owned<Vec> moved = copy_of(state);
                   check(VecAXPY(moved, -1, full.anchor));
                   check(VecDot(full.border.phase, moved, &along));
                   pack(full, full.orbit.defect, along / full.speed, R);
                 });
}

/// Before each linear solve: the phase row and the T column belong to the current point.
PetscErrorCode jacobian(SNES, Vec z, Mat, Mat, void* context)
{
  FullSpace& full = *static_cast<FullSpace*>(context);
  return guarded(full,
                 [&]
                 {
                   PetscBool same = PETSC_FALSE;
                   check(VecEqual(z, full.at, &same));
                   if (!same)
                   {
                     const Owned<Vec> state = zeros_like(full.orbit.state);
                     const double period = unpack(full, z, state);
                     full.orbit = evaluate(full.shooting, state, period);
                     check(VecCopy(z, full.at));
                   }
                   full.anchor = copy_of(full.orbit.state);
                   full.border = border_at(full.shooting, full.orbit);
                 });
}

/// (dPhi/dx - I) dx + d dT by one difference in dx, and the phase row.
PetscErrorCode multiply(Mat J, Vec dz, Vec product)
{
  FullSpace* full = nullptr;
  PetscCall(MatShellGetContext(J, &full));
  return guarded(*full,
                 [&]
                 {
                   const Flow& flow = full->shooting.flow;
                   const Owned<Vec> direction = zeros_like(full->orbit.state), end = zeros_like(full->orbit.state);
                   const double period = unpack(*full, dz, direction);
                   const double length = energy_norm(flow, direction);
                   double along = 0;
                   check(VecDot(full->border.phase, direction, &along));
                   if (length > 0)
                   {
                     const double step = full->shooting.options.difference * full->orbit.fluctuation / length;
                     const Owned<Vec> moved = copy_of(full->orbit.state);
                     check(VecAXPY(moved, step, direction));
                     flow.integrate(full->orbit.period, moved, end, nullptr);
                     ++full->shooting.periods;
                     check(VecAXPY(end, -1, moved));
                     check(VecAXPY(end, -1, full->orbit.defect));
                     check(VecScale(end, 1 / step));
                   }
                   check(VecAXPY(end, period, full->orbit.rate));
                   pack(*full, end, along / full->speed, product);
                 });
}

PetscErrorCode precondition(PC pc, Vec b, Vec z)
{
  FullSpace* full = nullptr;
  PetscCall(PCShellGetContext(pc, &full));
  return guarded(*full,
                 [&]
                 {
                   const Owned<Vec> rhs = zeros_like(full->orbit.state), x = zeros_like(full->orbit.state);
                   const double row = unpack(*full, b, rhs) * full->speed;
                   apply(full->shooting.preconditioner, full->orbit.period, rhs, x);
                   const double period = close_border(full->border, x, row);
                   pack(*full, x, period, z);
                 });
}

PetscErrorCode converged(SNES, PetscInt iteration, PetscReal, PetscReal, PetscReal, SNESConvergedReason* reason,
                         void* context)
{
  FullSpace& full = *static_cast<FullSpace*>(context);
  Shooting& shooting = full.shooting;
  return guarded(full,
                 [&]
                 {
                   record(shooting, "newton-krylov", full_unknowns(full.orbit), std::nan(""), full.orbit);
                   if (iteration > 0) ++shooting.iterations;
                   *reason = SNES_CONVERGED_ITERATING;
                   if (full.orbit.residual <= shooting.tolerance)
                     *reason = SNES_CONVERGED_FNORM_ABS;
                   else if (full.vanished > 1)
                     *reason = SNES_DIVERGED_FUNCTION_DOMAIN; // Newton leads to rest
                   else if (shooting.periods >= shooting.options.max_periods)
                     *reason = SNES_DIVERGED_FUNCTION_COUNT;
                 });
}

/// The solver with its defaults and the user's options.
Owned<SNES> make_solver(MPI_Comm comm)
{
  Owned<SNES> snes;
  check(SNESCreate(comm, snes.put()));
  check(SNESSetOptionsPrefix(snes, "cycle_full_"));
  check(SNESSetTolerances(snes, 0, 0, 0, 30, 10000));
  check(SNESSetMaxLinearSolveFailures(snes, 30)); // an inexact step is still one down the residual
  KSP ksp = nullptr;
  PC pc = nullptr;
  check(SNESGetKSP(snes, &ksp));
  check(KSPSetType(ksp, KSPGMRES));
  check(KSPGMRESSetRestart(ksp, 60));
  check(KSPSetTolerances(ksp, 1e-2, PETSC_DEFAULT, PETSC_DEFAULT, 60));
  check(KSPSetPCSide(ksp, PC_RIGHT));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCSHELL));
  check(SNESSetFromOptions(snes));
  return snes;
}

void set_up(SNES snes, FullSpace& full, Mat J, Vec R)
{
  check(SNESSetFunction(snes, R, function, &full));
  check(SNESSetJacobian(snes, J, J, jacobian, &full));
  check(SNESSetConvergenceTest(snes, converged, &full, nullptr));
  KSP ksp = nullptr;
  PC pc = nullptr;
  check(SNESGetKSP(snes, &ksp));
  check(KSPGetPC(ksp, &pc));
  PetscBool standard = PETSC_FALSE;
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCSHELL, &standard));
  if (!standard) return; // the user's choice
  check(PCShellSetContext(pc, &full));
  check(PCShellSetName(pc, "sliding modes, bordered"));
  check(PCShellSetApply(pc, precondition));
}

} // namespace

void declare_fallback_options()
{
  (void)make_solver(PETSC_COMM_WORLD);
}

Finish shoot_newton_krylov(Shooting& shooting, const Orbit& start)
{
  FullSpace full{shooting,
                 make_scale(shooting, start.period),
                 energy_norm(shooting.flow, start.rate),
                 copy_of(start),
                 {},
                 copy_of(start.state),
                 border_at(shooting, start),
                 copy_of(start),
                 0,
                 {}};
  const MPI_Comm comm = comm_of(displacement(start.state));
  PetscInt local = 0;
  check(VecGetLocalSize(displacement(start.state), &local));
  local = 2 * local + (rank_of(comm) == 0 ? 1 : 0);
  Owned<Vec> z, R;
  check(VecCreateMPI(comm, local, PETSC_DETERMINE, z.put()));
  R = zeros_like(z);
  full.at = zeros_like(z);
  pack(full, start.state, start.period, z);
  check(VecCopy(z, full.at));
  Owned<Mat> J;
  check(MatCreateShell(comm, local, local, PETSC_DETERMINE, PETSC_DETERMINE, &full, J.put()));
  check(MatShellSetOperation(J, MATOP_MULT, reinterpret_cast<void (*)(void)>(multiply)));
  const Owned<SNES> snes = make_solver(comm);
  set_up(snes, full, J, R);
  const PetscErrorCode code = SNESSolve(snes, nullptr, z);
  if (full.failure) std::rethrow_exception(full.failure);
  check(code);
  const bool done = full.best.residual <= shooting.tolerance;
  const Ending other = full.vanished > 1 ? Ending::vanished : Ending::stalled;
  return {std::move(full.best), done ? Ending::converged : other};
}

} // namespace squeal
