#include "squeal/contact/condensed.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Columns of B' solved for at once: MUMPS reads its factor once for all of them.
constexpr PetscInt columns_at_once = 128;

Owned<Mat> factor_by_mumps(Mat A)
{
  Owned<Mat> factor;
  MatFactorInfo settings;
  check(MatFactorInfoInitialize(&settings));
  check(MatGetFactor(A, MATSOLVERMUMPS, MAT_FACTOR_CHOLESKY, factor.put()));
  check(MatMumpsSetIcntl(factor, 27, columns_at_once));
  check(MatCholeskyFactorSymbolic(factor, A, nullptr, &settings));
  check(MatCholeskyFactorNumeric(factor, A, &settings));
  return factor;
}

bool failed(Mat factor)
{
  MatFactorError error = MAT_FACTOR_NOERROR;
  check(MatFactorGetError(factor, &error));
  return error != MAT_FACTOR_NOERROR;
}

/// The same start for any number of ranks, orthogonal to nothing in particular.
Owned<Vec> uneven_vector(Mat A)
{
  Owned<Vec> x;
  check(MatCreateVecs(A, x.put(), nullptr));
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(x, &first, &last));
  for (PetscInt i = first; i < last; ++i)
    check(VecSetValue(x, i, 1 + .5 * std::sin(7. * static_cast<double>(i) + 1), INSERT_VALUES));
  check(VecAssemblyBegin(x));
  check(VecAssemblyEnd(x));
  return x;
}

/// Inverse iteration: x becomes the motion that A resists least, next to D = diag(A); returns x'A x / x'D x.
double least_resistance(Mat factor, Vec D, Vec x)
{
  const auto load = zeros_like(x), scaled = zeros_like(x);
  double quotient = 1;
  for (int iteration = 0; iteration < 3; ++iteration)
  {
    double size = 0, work = 0, weight = 0;
    check(VecNorm(x, NORM_INFINITY, &size));
    if (!std::isfinite(size) || size == 0) return 0;
    check(VecScale(x, 1 / size));
    check(VecPointwiseMult(load, D, x));
    check(MatSolve(factor, load, x));
    check(VecPointwiseMult(scaled, D, x));
    check(VecDot(x, load, &work));
    check(VecDot(x, scaled, &weight));
    quotient = work / weight;
  }
  return quotient;
}

PetscInt largest_entry(Vec x)
{
  PetscInt where = 0;
  double value = 0;
  const auto size = zeros_like(x);
  check(VecCopy(x, size));
  check(VecAbs(size));
  check(VecMax(size, &where, &value));
  return where;
}

/// After a failed factorisation: the loose motion of A with a little added to its diagonal.
PetscInt loose_by_shift(Mat A, Vec D)
{
  double largest = 0;
  check(VecNorm(D, NORM_INFINITY, &largest));
  Owned<Mat> shifted;
  check(MatDuplicate(A, MAT_COPY_VALUES, shifted.put()));
  check(MatSetOption(shifted, MAT_SPD, PETSC_FALSE));
  check(MatSetOption(shifted, MAT_SYMMETRIC, PETSC_TRUE));
  check(MatShift(shifted, largest > 0 ? 1e-8 * largest : 1));
  const auto factor = factor_by_mumps(shifted);
  const auto x = uneven_vector(A);
  const auto uniform = zeros_like(D);
  check(VecSet(uniform, 1));
  if (!failed(factor)) least_resistance(factor, uniform, x);
  return largest_entry(x);
}

/// B whole on rank 0, no rows elsewhere.
Owned<Mat> whole_on_rank_zero(const Interface& interface)
{
  PetscInt rows = 0, columns = 0;
  check(MatGetSize(interface.B, &rows, &columns));
  const bool here = rank_of(PetscObjectComm((PetscObject)interface.B.get())) == 0;
  Owned<IS> row_set, column_set;
  check(ISCreateStride(PETSC_COMM_SELF, here ? rows : 0, 0, 1, row_set.put()));
  check(ISCreateStride(PETSC_COMM_SELF, columns, 0, 1, column_set.put()));
  Mat* parts = nullptr;
  const IS row_sets[] = {row_set}, column_sets[] = {column_set};
  check(MatCreateSubMatrices(interface.B, 1, row_sets, column_sets, MAT_INITIAL_MATRIX, &parts));
  Owned<Mat> result(parts[0]);
  check(PetscObjectReference((PetscObject)parts[0]));
  check(MatDestroySubMatrices(1, &parts));
  return result;
}

/// Rows [begin, begin + count) of B as a matrix of all ranks that lies whole on rank 0, which is how MUMPS takes
/// sparse right-hand sides; null on every rank if they have no entries, which MUMPS refuses.
Owned<Mat> right_hand_sides(Mat B, PetscInt begin, PetscInt count, PetscInt dofs, MPI_Comm comm)
{
  const bool here = rank_of(comm) == 0;
  Owned<Mat> result;
  check(MatCreate(comm, result.put()));
  check(MatSetSizes(result, here ? count : 0, here ? dofs : 0, count, dofs));
  check(MatSetType(result, MATAIJ));
  std::vector<PetscInt> lengths(static_cast<std::size_t>(here ? count : 0));
  for (PetscInt i = 0; i < (here ? count : 0); ++i)
  {
    check(MatGetRow(B, begin + i, &lengths[static_cast<std::size_t>(i)], nullptr, nullptr));
    PetscInt length = lengths[static_cast<std::size_t>(i)];
    check(MatRestoreRow(B, begin + i, &length, nullptr, nullptr));
  }
  check(MatSeqAIJSetPreallocation(result, 0, lengths.data()));
  check(MatMPIAIJSetPreallocation(result, 0, lengths.data(), 0, nullptr));
  for (PetscInt i = 0; i < (here ? count : 0); ++i)
  {
    PetscInt length = 0;
    const PetscInt* columns = nullptr;
    const double* values = nullptr;
    check(MatGetRow(B, begin + i, &length, &columns, &values));
    check(MatSetValues(result, 1, &i, length, columns, values, INSERT_VALUES));
    check(MatRestoreRow(B, begin + i, &length, &columns, &values));
  }
  check(MatAssemblyBegin(result, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(result, MAT_FINAL_ASSEMBLY));
  MatInfo info;
  check(MatGetInfo(result, MAT_GLOBAL_SUM, &info));
  return info.nz_used > 0 ? std::move(result) : Owned<Mat>();
}

/// Columns of a distributed dense matrix, gathered as rows of `target` (row length `length`) on rank 0.
void gather_columns(Mat dense, PetscInt columns, double scale, double* target, std::size_t length, MPI_Comm comm)
{
  PetscInt first = 0, last = 0, leading = 0;
  check(MatGetOwnershipRange(dense, &first, &last));
  check(MatDenseGetLDA(dense, &leading));
  const double* values = nullptr;
  check(MatDenseGetArrayRead(dense, &values));
  const int rows = static_cast<int>(last - first);
  std::vector<double> mine;
  for (PetscInt j = 0; j < columns; ++j) mine.insert(mine.end(), values + j * leading, values + j * leading + rows);
  check(MatDenseRestoreArrayRead(dense, &values));
  const std::size_t ranks = static_cast<std::size_t>(ranks_of(comm));
  std::vector<int> counts(ranks), starts(ranks, 0);
  MPI_Gather(&rows, 1, MPI_INT, counts.data(), 1, MPI_INT, 0, comm);
  std::vector<int> sizes(ranks);
  for (std::size_t p = 0; p < ranks; ++p) sizes[p] = counts[p] * static_cast<int>(columns);
  for (std::size_t p = 1; p < ranks; ++p) starts[p] = starts[p - 1] + sizes[p - 1];
  const bool here = rank_of(comm) == 0;
  std::vector<double> all(here ? length * static_cast<std::size_t>(columns) : 0);
  MPI_Gatherv(mine.data(), static_cast<int>(mine.size()), MPI_DOUBLE, all.data(), sizes.data(), starts.data(),
              MPI_DOUBLE, 0, comm);
  if (!here) return;
  const double* next = all.data();
  std::size_t offset = 0;
  for (const int count : counts)
  {
    for (std::size_t j = 0; j < static_cast<std::size_t>(columns); ++j)
      for (int i = 0; i < count; ++i) target[j * length + offset + static_cast<std::size_t>(i)] = scale * *next++;
    offset += static_cast<std::size_t>(count);
  }
}

void symmetrise(std::vector<double>& W, std::size_t n)
{
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < i; ++j) W[i * n + j] = W[j * n + i] = (W[i * n + j] + W[j * n + i]) / 2;
}

} // namespace

Factored factor_positive(Mat A)
{
  PetscBool known = PETSC_FALSE, positive = PETSC_FALSE;
  check(MatIsSPDKnown(A, &known, &positive));
  check(MatSetOption(A, MAT_SPD, PETSC_TRUE)); // MUMPS then takes L L'
  Factored result;
  result.factor = factor_by_mumps(A);
  // whether it is true is only known now, and a copy of A may be shifted: leave no claim behind
  if (!(known && positive)) check(MatSetOption(A, MAT_SPD, PETSC_FALSE));
  Owned<Vec> D;
  check(MatCreateVecs(A, D.put(), nullptr));
  check(MatGetDiagonal(A, D));
  if (failed(result.factor))
  {
    result.loose = loose_by_shift(A, D);
    return result;
  }
  // a singular matrix often factors without complaint; rounding leaves it this much resistance and no more
  const auto x = uneven_vector(A);
  if (!(least_resistance(result.factor, D, x) > 1e-14)) result.loose = largest_entry(x);
  return result;
}

std::vector<double> condensed_matrix(Mat factor, const Interface& interface, double scale)
{
  const std::size_t n = interface.size();
  if (n == 0) return {};
  const auto comm = PetscObjectComm((PetscObject)interface.B.get());
  const bool here = rank_of(comm) == 0;
  std::vector<double> W(here ? n * n : 0);
  PetscInt dofs = 0, own_dofs = 0;
  check(MatGetSize(interface.B, nullptr, &dofs));
  check(MatGetLocalSize(interface.B, nullptr, &own_dofs));
  const auto B = whole_on_rank_zero(interface);
  for (PetscInt begin = 0; begin < static_cast<PetscInt>(n); begin += columns_at_once)
  {
    const PetscInt count = std::min(columns_at_once, static_cast<PetscInt>(n) - begin);
    const auto rows = right_hand_sides(B, begin, count, dofs, comm);
    if (!rows) continue; // pairs that cannot move
    Owned<Mat> columns, X, product;
    check(MatCreateTranspose(rows, columns.put()));
    check(MatCreateDense(comm, own_dofs, here ? count : 0, dofs, count, nullptr, X.put()));
    check(MatMatSolve(factor, columns, X));
    check(MatMatMult(interface.B, X, MAT_INITIAL_MATRIX, PETSC_DEFAULT, product.put()));
    gather_columns(product, count, scale, here ? W.data() + static_cast<std::size_t>(begin) * n : nullptr, n, comm);
  }
  if (here) symmetrise(W, n);
  return W;
}

CondensedOperator condense(Mat A, const Interface& interface, double scale, const DofNames& names)
{
  auto [factor, loose] = factor_positive(A);
  if (loose)
    throw Error("singular: nothing resists a motion that is largest at " + describe(names, *loose) +
                "; give it a support, a spring or mass");
  CondensedOperator condensed;
  condensed.factor = std::move(factor);
  condensed.W = condensed_matrix(condensed.factor, interface, scale);
  condensed.size = static_cast<int>(interface.size());
  return condensed;
}

void solve(const CondensedOperator& condensed, Vec b, Vec x)
{
  check(MatSolve(condensed.factor, b, x));
}

} // namespace squeal
