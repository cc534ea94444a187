#include "newton_krylov.hpp"

#include "bordered_system.hpp"
#include "shell_preconditioner.hpp"
#include "squeal/base/callback.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// What PETSc's callbacks share.
struct FullSpaceSystem
{
  const OrbitProblem& problem;
  const ShootingOptions& options;
  ConvergenceLog& log;
  Owned<Vec> scale; // (omega sqrt(m), sqrt(m))
  double speed = 0;
  Orbit orbit;           // evaluated last
  Owned<Vec> at, anchor; // z and the state of that orbit; the state where the phase row belongs
  Border border;
  Owned<Vec> base; // Phi_T(x) - x there
  Orbit best;
  int collapses = 0; // points met that fall onto the equilibrium
  std::exception_ptr failure;
};

/// z = (scaled state, speed * border). The border is an entry of rank 0, after this rank's part of the state.
void pack(const FullSpaceSystem& system, Vec state, double border, Vec z)
{
  const Owned<Vec> scaled = zeros_like(state);
  check(VecPointwiseMult(displacement(scaled), displacement(system.scale), displacement(state)));
  check(VecPointwiseMult(velocity(scaled), velocity(system.scale), velocity(state)));
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
  if (rank_of(comm_of(z)) == 0) to[offset] = system.speed * border;
  check(VecRestoreArray(z, &to));
}

double unpack(const FullSpaceSystem& system, Vec z, Vec state)
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
  double border = rank_of(comm) == 0 ? from[offset] / system.speed : 0;
  MPI_Bcast(&border, 1, MPI_DOUBLE, 0, comm);
  check(VecRestoreArrayRead(z, &from));
  check(VecPointwiseDivide(displacement(state), displacement(state), displacement(system.scale)));
  check(VecPointwiseDivide(velocity(state), velocity(state), velocity(system.scale)));
  return border;
}

Owned<Vec> make_scale(const OrbitProblem& problem, double period)
{
  Owned<Vec> scale = zeros_like(problem.equilibrium);
  const Vec mass = velocity(scale);
  double largest = 0;
  check(MatGetDiagonal(problem.flow.M, mass));
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

/// R = (F, <f, x - anchor>/speed), or large values where the point is outside the solver's bounds.
void form_residual(FullSpaceSystem& system, Vec z, Vec R)
{
  const Owned<Vec> state = zeros_like(system.orbit.state);
  const double period = unpack(system, z, state);
  check(VecSet(R, 1e6 * system.orbit.fluctuation)); // far outside: the line search comes back
  if (!admissible_period(system.problem, period)) return;
  PetscBool same = PETSC_FALSE;
  check(VecEqual(z, system.at, &same));
  if (!same)
  {
    Orbit orbit = evaluate(system.problem, system.log, state, period);
    const bool collapses = collapsing(system.problem, orbit);
    if (collapses) ++system.collapses;
    if (collapses || !std::isfinite(orbit.residual)) return;
    system.orbit = std::move(orbit);
    check(VecCopy(z, system.at));
    if (system.orbit.residual < system.best.residual) system.best = copy_of(system.orbit);
  }
  double along = 0;
  const Owned<Vec> moved = copy_of(state);
  check(VecAXPY(moved, -1, system.anchor));
  check(VecDot(system.border.phase, moved, &along));
  pack(system, system.orbit.defect, along / system.speed, R);
}

/// Moves the phase row and the T column to z.
void form_border(FullSpaceSystem& system, Vec z)
{
  PetscBool same = PETSC_FALSE;
  check(VecEqual(z, system.at, &same));
  if (!same)
  {
    const Owned<Vec> state = zeros_like(system.orbit.state);
    const double period = unpack(system, z, state);
    system.orbit = evaluate(system.problem, system.log, state, period);
    check(VecCopy(z, system.at));
  }
  system.anchor = copy_of(system.orbit.state);
  system.border = border_at(system.problem, system.orbit);
  system.base = base_of_differences(system.problem, system.log, system.orbit);
}

/// (dPhi/dx - I) dx + d dT by one difference in dx, and the phase row.
void apply_jacobian(FullSpaceSystem& system, Vec dz, Vec product)
{
  const Flow& flow = system.problem.flow;
  const Owned<Vec> direction = zeros_like(system.orbit.state), end = zeros_like(system.orbit.state);
  const double period = unpack(system, dz, direction);
  const double length = energy_norm(flow, direction);
  double along = 0;
  check(VecDot(system.border.phase, direction, &along));
  if (length > 0)
  {
    const double step = system.options.difference * system.orbit.fluctuation / length;
    const Owned<Vec> moved = copy_of(system.orbit.state);
    check(VecAXPY(moved, step, direction));
    flow.integrate(system.orbit.period, moved, end, nullptr);
    ++system.log.convergence.periods;
    check(VecAXPY(end, -1, moved));
    check(VecAXPY(end, -1, system.base));
    check(VecScale(end, 1 / step));
  }
  check(VecAXPY(end, period, system.orbit.rate));
  pack(system, end, along / system.speed, product);
}

void apply_bordered_preconditioner(const FullSpaceSystem& system, Vec b, Vec z)
{
  const Owned<Vec> rhs = zeros_like(system.orbit.state), x = zeros_like(system.orbit.state);
  const double row = unpack(system, b, rhs) * system.speed;
  apply(system.problem.preconditioner, system.orbit.period, rhs, x);
  const double period = close_border(system.border, x, row);
  pack(system, x, period, z);
}

SNESConvergedReason reason_to_stop(FullSpaceSystem& system, PetscInt iteration)
{
  record_full(system.log, ShootingStage::newton_krylov, system.orbit);
  if (iteration > 0) ++system.log.convergence.iterations;
  if (system.orbit.residual <= system.problem.tolerance) return SNES_CONVERGED_FNORM_ABS;
  if (system.collapses > 1) return SNES_DIVERGED_FUNCTION_DOMAIN; // Newton leads to rest
  if (system.log.convergence.periods >= system.options.max_periods) return SNES_DIVERGED_FUNCTION_COUNT;
  return SNES_CONVERGED_ITERATING;
}

PetscErrorCode residual_callback(SNES, Vec z, Vec R, void* context)
{
  FullSpaceSystem& system = *static_cast<FullSpaceSystem*>(context);
  return guarded(system.failure, [&] { form_residual(system, z, R); });
}

PetscErrorCode jacobian_callback(SNES, Vec z, Mat, Mat, void* context)
{
  FullSpaceSystem& system = *static_cast<FullSpaceSystem*>(context);
  return guarded(system.failure, [&] { form_border(system, z); });
}

PetscErrorCode multiply_callback(Mat J, Vec dz, Vec product)
{
  FullSpaceSystem* system = nullptr;
  PetscCall(MatShellGetContext(J, &system));
  return guarded(system->failure, [&] { apply_jacobian(*system, dz, product); });
}

PetscErrorCode precondition_callback(PC pc, Vec b, Vec z)
{
  FullSpaceSystem* system = nullptr;
  PetscCall(PCShellGetContext(pc, &system));
  return guarded(system->failure, [&] { apply_bordered_preconditioner(*system, b, z); });
}

PetscErrorCode convergence_callback(SNES, PetscInt iteration, PetscReal, PetscReal, PetscReal,
                                    SNESConvergedReason* reason, void* context)
{
  FullSpaceSystem& system = *static_cast<FullSpaceSystem*>(context);
  return guarded(system.failure, [&] { *reason = reason_to_stop(system, iteration); });
}

/// The solver with its defaults and the user's options.
Owned<SNES> make_solver(MPI_Comm comm)
{
  Owned<SNES> snes;
  check(SNESCreate(comm, snes.put()));
  check(SNESSetOptionsPrefix(snes, "cycle_full_"));
  check(SNESSetTolerances(snes, 0, 0, 0, 30, 10000));
  check(SNESSetMaxLinearSolveFailures(snes, 30)); // an inexact step still reduces the residual
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

void set_callbacks(SNES snes, FullSpaceSystem& system, Mat J, Vec R)
{
  check(SNESSetFunction(snes, R, residual_callback, &system));
  check(SNESSetJacobian(snes, J, J, jacobian_callback, &system));
  check(SNESSetConvergenceTest(snes, convergence_callback, &system, nullptr));
  set_shell_preconditioner(snes, {"of the period map, bordered", &system, precondition_callback});
}

} // namespace

void declare_newton_krylov_options()
{
  (void)make_solver(PETSC_COMM_WORLD);
}

StageResult shoot_by_newton_krylov(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                   const Orbit& start)
{
  FullSpaceSystem system{problem,
                         options,
                         log,
                         make_scale(problem, start.period),
                         energy_norm(problem.flow, start.rate),
                         copy_of(start),
                         {},
                         copy_of(start.state),
                         border_at(problem, start),
                         {},
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
  system.at = zeros_like(z);
  pack(system, start.state, start.period, z);
  check(VecCopy(z, system.at));
  Owned<Mat> J;
  check(MatCreateShell(comm, local, local, PETSC_DETERMINE, PETSC_DETERMINE, &system, J.put()));
  check(MatShellSetOperation(J, MATOP_MULT, reinterpret_cast<void (*)(void)>(multiply_callback)));
  const Owned<SNES> snes = make_solver(comm);
  set_callbacks(snes, system, J, R);
  check_after_callbacks(SNESSolve(snes, nullptr, z), system.failure);
  const bool done = system.best.residual <= problem.tolerance;
  const StageEnding other = system.collapses > 1 ? StageEnding::collapsed : StageEnding::stalled;
  return {std::move(system.best), done ? StageEnding::converged : other};
}

} // namespace squeal
