/// P^-1 x = -x + E D E^+ x: the bulk of the period map is linear and known. A state outside the modes' span is taken as
/// forgotten within a period (dPhi/dx = 0, inverse -1); inside it the theta step of each mode is a 2 x 2 matrix,
///     u+ = u + h (theta v+ + (1-theta) v),   a v+ = [1 - h(1-theta) c - h^2 theta(1-theta) w^2] v - h w^2 u,
///     a = 1 + h theta c + h^2 theta^2 w^2,   c = phi'C phi.
/// It holds no friction and no unstable pair: at the cycle that pair has become {1, a contraction}.
#include "squeal/analysis/shooting.hpp"

#include <array>
#include <cmath>

namespace squeal
{

namespace
{

using Matrix2 = std::array<double, 4>; // row-major

Matrix2 product(const Matrix2& a, const Matrix2& b)
{
  return {a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3], a[2] * b[0] + a[3] * b[2], a[2] * b[1] + a[3] * b[3]};
}

Matrix2 modal_step(double omega, double damping, double h, double theta)
{
  const double w2 = omega * omega, a = 1 + h * theta * damping + h * h * theta * theta * w2;
  const double from_v = (1 - h * (1 - theta) * damping - h * h * theta * (1 - theta) * w2) / a, from_u = -h * w2 / a;
  return {1 + h * theta * from_u, h * (theta * from_v + 1 - theta), from_u, from_v};
}

/// (G^N - 1)^-1 + 1; zero where G^N - 1 cannot be inverted (a rigid-body motion, or a resonance without damping).
Matrix2 correction(Matrix2 power, int steps)
{
  Matrix2 map = {1, 0, 0, 1};
  for (; steps > 0; steps /= 2, power = product(power, power))
    if (steps % 2 == 1) map = product(map, power);
  const double a = map[0] - 1, b = map[1], c = map[2], d = map[3] - 1, determinant = a * d - b * c;
  if (std::abs(determinant) < 1e-8) return {};
  return {d / determinant + 1, -b / determinant, -c / determinant, a / determinant + 1};
}

} // namespace

RealModePreconditioner make_preconditioner(const Structure& structure, const RealModes& modes, int steps, double theta)
{
  RealModePreconditioner result;
  result.steps = steps;
  result.theta = theta;
  const PetscInt count = static_cast<PetscInt>(modes.shapes.size());
  if (count == 0) return result;
  PetscInt rows = 0;
  check(VecGetLocalSize(structure.load, &rows));
  const MPI_Comm comm = PetscObjectComm(reinterpret_cast<PetscObject>(structure.load.get()));
  check(MatCreateDense(comm, rows, PETSC_DECIDE, PETSC_DETERMINE, count, nullptr, result.shapes.put()));
  check(MatCreateDense(comm, rows, PETSC_DECIDE, PETSC_DETERMINE, count, nullptr, result.weighted.put()));
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRangeColumn(result.shapes, &first, &last));
  const Owned<Vec> damped = zeros_like(structure.load);
  for (PetscInt i = 0; i < count; ++i)
  {
    const Vec shape = modes.shapes[static_cast<std::size_t>(i)];
    Vec column = nullptr;
    check(MatDenseGetColumnVecWrite(result.shapes, i, &column));
    check(VecCopy(shape, column));
    check(MatDenseRestoreColumnVecWrite(result.shapes, i, &column));
    check(MatDenseGetColumnVecWrite(result.weighted, i, &column));
    check(MatMult(structure.M, shape, column));
    check(MatDenseRestoreColumnVecWrite(result.weighted, i, &column));
    double damping = 0;
    check(MatMult(structure.C, shape, damped));
    check(VecDot(shape, damped, &damping));
    if (i < first || i >= last) continue;
    result.omega.push_back(modes.omega[static_cast<std::size_t>(i)]);
    result.damping.push_back(damping);
  }
  for (const Mat matrix : {result.shapes.get(), result.weighted.get()})
  {
    check(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
    check(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  }
  return result;
}

void apply(const RealModePreconditioner& preconditioner, double period, Vec x, Vec y)
{
  check(VecCopy(x, y));
  check(VecScale(y, -1));
  if (!preconditioner.shapes.get()) return;
  Owned<Vec> u, v;
  check(MatCreateVecs(preconditioner.weighted, u.put(), nullptr));
  check(VecDuplicate(u, v.put()));
  check(MatMultTranspose(preconditioner.weighted, displacement(x), u));
  check(MatMultTranspose(preconditioner.weighted, velocity(x), v));
  double *mode_u = nullptr, *mode_v = nullptr;
  check(VecGetArray(u, &mode_u));
  check(VecGetArray(v, &mode_v));
  for (std::size_t i = 0; i < preconditioner.omega.size(); ++i)
  {
    const Matrix2 step = modal_step(preconditioner.omega[i], preconditioner.damping[i], period / preconditioner.steps,
                                    preconditioner.theta);
    const Matrix2 D = correction(step, preconditioner.steps);
    const double old_u = mode_u[i], old_v = mode_v[i];
    mode_u[i] = D[0] * old_u + D[1] * old_v;
    mode_v[i] = D[2] * old_u + D[3] * old_v;
  }
  check(VecRestoreArray(u, &mode_u));
  check(VecRestoreArray(v, &mode_v));
  check(MatMultAdd(preconditioner.shapes, u, displacement(y), displacement(y)));
  check(MatMultAdd(preconditioner.shapes, v, velocity(y), velocity(y)));
}

double solve_bordered(const Shooting& shooting, const Orbit& orbit, Vec phase, Vec b, double border, Vec x)
{
  const Owned<Vec> column = zeros_like(b);
  apply(shooting.preconditioner, orbit.period, b, x);
  apply(shooting.preconditioner, orbit.period, orbit.rate, column);
  double along_x = 0, along_column = 0;
  check(VecDot(phase, x, &along_x));
  check(VecDot(phase, column, &along_column));
  const double t = (border - along_x) / -along_column;
  check(VecAXPY(x, -t, column));
  return t;
}

} // namespace squeal
