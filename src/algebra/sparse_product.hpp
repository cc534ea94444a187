#pragma once
/// Products of a sparse matrix with many columns.
#include "squeal/base/petsc.hpp"

#include <Eigen/Core>

namespace squeal
{

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

} // namespace squeal
