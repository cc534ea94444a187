#include "squeal/algebra/multivector.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <petscblaslapack.h>

namespace squeal
{

namespace
{

using Index = std::size_t;

// Lends the entries to PETSc as a dense matrix.
Owned<Mat> as_matrix(const Block& X)
{
  Owned<Mat> A;
  check(MatCreateDense(X.comm, X.rows, PETSC_DECIDE, PETSC_DETERMINE, X.columns, const_cast<double*>(X.entries.data()),
                       A.put()));
  return A;
}

Block zero_block(MPI_Comm comm, PetscInt rows, PetscInt columns)
{
  return {comm, rows, columns, std::vector<double>(static_cast<Index>(rows) * static_cast<Index>(columns), 0.0)};
}

void drop_columns(Block& X, double least)
{
  const std::vector<double> norms = column_norms(X);
  PetscInt kept = 0;
  for (PetscInt j = 0; j < X.columns; ++j)
    if (norms[static_cast<Index>(j)] > least)
    {
      if (kept != j) std::copy_n(X.column(j), X.rows, X.column(kept));
      ++kept;
    }
  X.columns = kept;
  X.entries.resize(static_cast<Index>(X.rows) * static_cast<Index>(kept));
}

// To unit length; columns of zeros go.
void normalise_columns(Block& X)
{
  drop_columns(X, 0);
  const std::vector<double> norms = column_norms(X);
  for (PetscInt j = 0; j < X.columns; ++j)
    std::transform(X.column(j), X.column(j) + X.rows, X.column(j),
                   [&](double x) { return x / norms[static_cast<Index>(j)]; });
}

} // namespace

Block empty_block(Mat A)
{
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRangeColumn(A, &first, &last));
  return {comm_of(A), last - first, 0, {}};
}

Block uneven_block(Mat A, PetscInt columns)
{
  Block X = empty_block(A);
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRangeColumn(A, &first, &last));
  std::uint64_t state = 0;
  const auto next = [&](std::uint64_t seed) // splitmix64
  {
    state = seed + 0x9e3779b97f4a7c15u;
    state = (state ^ (state >> 30)) * 0xbf58476d1ce4e5b9u;
    state = (state ^ (state >> 27)) * 0x94d049bb133111ebu;
    return static_cast<double>((state ^ (state >> 31)) >> 11) * 0x1p-52 - 1;
  };
  for (PetscInt j = 0; j < columns; ++j)
    for (PetscInt i = first; i < last; ++i)
      X.entries.push_back(next(0x9e3779b97f4a7c15u * static_cast<std::uint64_t>(i * columns + j + 1)));
  X.columns = columns;
  return X;
}

void append(Block& X, Vec x)
{
  const PetscScalar* values = nullptr;
  check(VecGetArrayRead(x, &values));
  X.entries.insert(X.entries.end(), values, values + X.rows);
  check(VecRestoreArrayRead(x, &values));
  ++X.columns;
}

void append(Block& X, const Block& Y)
{
  X.entries.insert(X.entries.end(), Y.entries.begin(), Y.entries.end());
  X.columns += Y.columns;
}

void copy_column(const Block& X, PetscInt j, Vec x)
{
  PetscScalar* values = nullptr;
  check(VecGetArrayWrite(x, &values));
  std::copy_n(X.column(j), X.rows, values);
  check(VecRestoreArrayWrite(x, &values));
}

Block product(Mat A, const Block& X)
{
  PetscInt rows = 0;
  check(MatGetLocalSize(A, &rows, nullptr));
  Block Y = zero_block(X.comm, rows, X.columns);
  if (X.columns == 0) return Y;
  const Owned<Mat> from = as_matrix(X);
  Owned<Mat> to;
  check(MatMatMult(A, from, MAT_INITIAL_MATRIX, PETSC_DEFAULT, to.put()));
  const PetscScalar* values = nullptr;
  check(MatDenseGetArrayRead(to, &values));
  std::copy_n(values, Y.entries.size(), Y.entries.begin());
  check(MatDenseRestoreArrayRead(to, &values));
  return Y;
}

std::vector<double> inner(const Block& X, const Block& Y)
{
  std::vector<double> result(static_cast<Index>(X.columns * Y.columns), 0.0);
  const PetscBLASInt rows = static_cast<PetscBLASInt>(X.rows), left = static_cast<PetscBLASInt>(X.columns),
                     right = static_cast<PetscBLASInt>(Y.columns), leading = std::max(rows, 1);
  const double one = 1, zero = 0;
  if (left > 0 && right > 0)
    BLASgemm_("T", "N", &left, &right, &rows, &one, X.entries.data(), &leading, Y.entries.data(), &leading, &zero,
              result.data(), &left);
  // to one and from there to all: the last bit is everybody's, too
  const auto size = static_cast<int>(result.size());
  const bool here = rank_of(X.comm) == 0;
  MPI_Reduce(here ? MPI_IN_PLACE : result.data(), result.data(), size, MPI_DOUBLE, MPI_SUM, 0, X.comm);
  MPI_Bcast(result.data(), size, MPI_DOUBLE, 0, X.comm);
  return result;
}

void add_combination(Block& Y, double alpha, const Block& X, const std::vector<double>& a)
{
  const PetscBLASInt rows = static_cast<PetscBLASInt>(X.rows), inside = static_cast<PetscBLASInt>(X.columns),
                     columns = static_cast<PetscBLASInt>(Y.columns), leading = std::max(rows, 1);
  const double one = 1;
  if (rows > 0 && inside > 0 && columns > 0)
    BLASgemm_("N", "N", &rows, &columns, &inside, &alpha, X.entries.data(), &leading, a.data(), &inside, &one,
              Y.entries.data(), &leading);
}

Block columns_from(const Block& X, PetscInt first)
{
  return {X.comm, X.rows, X.columns - first, {X.column(first), X.column(X.columns)}};
}

Block combination(const Block& X, const std::vector<double>& a, PetscInt columns)
{
  Block Y = zero_block(X.comm, X.rows, columns);
  add_combination(Y, 1, X, a);
  return Y;
}

std::vector<double> column_norms(const Block& X)
{
  std::vector<double> squares(static_cast<Index>(X.columns));
  for (PetscInt j = 0; j < X.columns; ++j)
    for (const double* x = X.column(j); x != X.column(j) + X.rows; ++x) squares[static_cast<Index>(j)] += *x * *x;
  MPI_Allreduce(MPI_IN_PLACE, squares.data(), static_cast<int>(squares.size()), MPI_DOUBLE, MPI_SUM, X.comm);
  for (double& value : squares) value = std::sqrt(value);
  return squares;
}

void orthonormalise(Block& X, double least)
{
  std::vector<double> G = inner(X, X), values(static_cast<Index>(X.columns));
  const PetscBLASInt order = static_cast<PetscBLASInt>(X.columns);
  PetscBLASInt info = 0, size = std::max(1, 34 * order);
  std::vector<double> work(static_cast<Index>(size));
  LAPACKsyev_("V", "U", &order, G.data(), &order, values.data(), work.data(), &size, &info);
  if (info != 0) throw Error("LAPACK's symmetric eigensolver (syev) failed on an inner product");
  PetscInt kept = 0;
  std::vector<double> a;
  for (PetscInt j = 0; j < X.columns; ++j)
  {
    const double value = values[static_cast<Index>(j)];
    if (!(value > least * values.back())) continue;
    for (PetscInt i = 0; i < X.columns; ++i) a.push_back(G[static_cast<Index>(i + j * X.columns)] / std::sqrt(value));
    ++kept;
  }
  X = combination(X, a, kept);
}

PetscInt extend_orthonormal(Block& V, Block X)
{
  constexpr double nothing = 1e-12, rounding = 1e-13;
  const PetscInt before = V.columns;
  normalise_columns(X);
  // A round takes the directions that are not small beside others, 3e-7 and up; the next rounds take what it left.
  for (int round = 0; round < 4 && X.columns > 0; ++round)
  {
    add_combination(X, -1, V, inner(V, X));
    drop_columns(X, nothing);
    Block Y = X;
    normalise_columns(Y);
    if (Y.columns == 0) break;
    orthonormalise(Y, rounding);
    add_combination(Y, -1, V, inner(V, Y)); // rounding over a small part is not small
    drop_columns(Y, 0.5);
    if (Y.columns == 0) break;
    normalise_columns(Y);
    orthonormalise(Y, rounding);
    append(V, Y);
    if (Y.columns == X.columns) break;
  }
  return V.columns - before;
}

} // namespace squeal
