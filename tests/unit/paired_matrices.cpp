// ranks: 1 2 3
#include "squeal/algebra/multivector.hpp"
#include "squeal/algebra/sparse_matrices.hpp"

#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;

namespace
{

/// Symmetric, with entries on the diagonals that are a multiple of `every` away.
Owned<Mat> striped(PetscInt size, PetscInt every)
{
  Owned<Mat> A;
  check(MatCreateAIJ(PETSC_COMM_WORLD, PETSC_DECIDE, PETSC_DECIDE, size, size, size, nullptr, size, nullptr, A.put()));
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(A, &first, &last));
  for (PetscInt i = first; i < last; ++i)
    for (PetscInt j = i % every; j < size; j += every)
      check(MatSetValue(A, i, j, std::cos(static_cast<double>(i + j)) + 0.1 * static_cast<double>(i * j % 5),
                        INSERT_VALUES));
  check(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  return A;
}

Owned<Vec> wave(Mat A, double number)
{
  Owned<Vec> x;
  check(MatCreateVecs(A, x.put(), nullptr));
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(x, &first, &last));
  for (PetscInt i = first; i < last; ++i)
    check(VecSetValue(x, i, std::sin(number + 0.3 * static_cast<double>(i)), INSERT_VALUES));
  check(VecAssemblyBegin(x));
  check(VecAssemblyEnd(x));
  return x;
}

double difference(Mat A, Vec x, Vec y)
{
  Owned<Vec> Ax;
  check(MatCreateVecs(A, nullptr, Ax.put()));
  check(MatMult(A, x, Ax));
  check(VecAXPY(Ax, -1, y));
  double norm = 0;
  check(VecNorm(Ax, NORM_INFINITY, &norm));
  return norm;
}

} // namespace

TEST_CASE("matrices side by side give the products of each; those of two patterns stay apart")
{
  const auto M = striped(41, 3), K = copy_of(M.get());
  check(MatScale(K, 0.7));
  CHECK_FALSE(pair_matrices(M, striped(41, 2)).has_value());
  const std::optional<PairedMatrices> matrices = pair_matrices(M, K);
  REQUIRE(matrices.has_value());
  const auto v = wave(M, 0), u = wave(M, 1), Mv = wave(M, 2), Ku = wave(M, 3);
  multiply_both(*matrices, {v, u}, {Mv, Ku});
  CHECK(difference(M, v, Mv) < 1e-13); // rounding of sums of 20 numbers of size 1
  CHECK(difference(K, u, Ku) < 1e-13);
}

TEST_CASE("a sparse matrix, wide or of few rows, gives the same products of many columns and of one")
{
  const Owned<Mat> A = striped(41, 3);
  Owned<IS> few;
  Owned<Mat> rows;
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(A, &first, &last));
  check(ISCreateStride(PETSC_COMM_WORLD, first == 0 ? 2 : 0, 0, 1, few.put())); // all on one rank
  Owned<IS> all;
  check(ISCreateStride(PETSC_COMM_WORLD, last - first, first, 1, all.put()));
  check(MatCreateSubMatrix(A, few, all, MAT_INITIAL_MATRIX, rows.put()));
  for (Mat matrix : {A.get(), rows.get()})
    for (const PetscInt count : {3, 16, 17, 40})
    {
      const MultiVector X = random_multivector(A, count), Y = product(matrix, X);
      const Owned<Vec> x = vector_of_columns(matrix), y = vector_of_rows(matrix);
      for (PetscInt j = 0; j < count; ++j)
      {
        copy_column(X, j, x);
        copy_column(Y, j, y);
        CHECK(difference(matrix, x, y) < 1e-13); // rounding of sums of 20 numbers of size 1
      }
    }
}
