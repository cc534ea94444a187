#pragma once
/// M and K, symmetric, stored together (src/README.md, section 8.5). One pass gives the products of both. Of the
/// columns that a rank owns the upper triangle is stored, of others each entry.
#include "squeal/base/petsc.hpp"

#include <array>
#include <Eigen/Core>
#include <optional>
#include <petscsf.h>
#include <span>
#include <vector>

namespace squeal
{

/// Entries of M and K by rows: M_ij, K_ij.
struct PairedRows
{
  std::vector<PetscInt> starts{0}, columns{};
  std::vector<std::array<double, 2>> values{};
};

/// The entries of M and K of this rank, and what it exchanges with others for a product.
struct PairedMatrices
{
  MPI_Comm comm = MPI_COMM_NULL;
  PairedRows own;           // from the diagonal on
  PairedRows foreign;       // columns of other ranks, counted in the order in which they are received
  std::size_t received = 0; // number of these columns
  Owned<PetscSF> exchange;  // of their rows
};

/// Nothing unless M and K are sparse and of one pattern with the diagonal. Collective.
std::optional<PairedMatrices> pair_matrices(Mat M, Mat K);

/// `to` = (M v, K u) of `of` = (v, u). Collective.
void multiply_both(const PairedMatrices& matrices, const std::array<Vec, 2>& of, const std::array<Vec, 2>& to);

// Products of a sparse matrix with many columns.

/// Neighbouring numbers as one entry of a message, for as long as it lives.
struct RowType
{
  explicit RowType(std::size_t numbers);
  RowType(const RowType&) = delete;
  RowType& operator=(const RowType&) = delete;
  ~RowType();

  MPI_Datatype type = MPI_DATATYPE_NULL;
};

/// The rows of a matrix on one rank, lent for as long as the object lives.
class CompressedRows
{
public:
  explicit CompressedRows(Mat A) : A_(A)
  {
    PetscBool done = PETSC_FALSE;
    check(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &rows, &starts, &columns, &done));
    check(MatSeqAIJGetArrayRead(A, &values));
  }
  ~CompressedRows()
  {
    PetscBool done = PETSC_FALSE;
    (void)MatSeqAIJRestoreArrayRead(A_, &values);
    (void)MatRestoreRowIJ(A_, 0, PETSC_FALSE, PETSC_FALSE, &rows, &starts, &columns, &done);
  }
  CompressedRows(const CompressedRows&) = delete;
  CompressedRows& operator=(const CompressedRows&) = delete;

  PetscInt rows = 0;
  const PetscInt *starts = nullptr, *columns = nullptr;
  const PetscScalar* values = nullptr;

private:
  Mat A_;
};

/// The part of A on this rank's columns, and that on other ranks' with the exchange of their rows.
struct SplitMatrix
{
  Mat own = nullptr, foreign = nullptr; // foreign: null of SEQAIJ
  PetscInt received = 0;
  Owned<PetscSF> exchange{};
};

SplitMatrix split(Mat A);

/// Whether A is stored by compressed rows (AIJ).
bool is_sparse(Mat A);

/// A X of a sparse A for this rank's rows of both. Sixteen columns at a time go side by side through one reading of A,
/// where PETSc's product takes four. Collective.
Eigen::MatrixXd sparse_product(Mat A, const Eigen::MatrixXd& X);

// The residual of the quadratic eigenproblem with distributed matrices and real arithmetic.

/// Borrowed.
struct QuadraticMatrices
{
  Mat M, C, K;
};

/// Borrowed; the two parts of a complex vector.
struct ComplexVector
{
  Vec real, imaginary;
};

/// residual = (lambda^2 M + lambda C + K) y. Collective.
void quadratic_residual(const QuadraticMatrices& A, std::complex<double> lambda, ComplexVector y,
                        ComplexVector residual);

} // namespace squeal
