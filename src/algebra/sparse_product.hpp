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

/// Whether A is stored by compressed rows (AIJ).
bool is_sparse(Mat A);

/// A X of a sparse A for this rank's rows of both. Sixteen columns at a time go side by side through one reading of A,
/// where PETSc's product takes four. Collective.
Eigen::MatrixXd sparse_product(Mat A, const Eigen::MatrixXd& X);

} // namespace squeal
