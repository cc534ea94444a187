#include "sparse_product.hpp"

#include <algorithm>
#include <petscsf.h>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int lanes = 16; // columns at once

using Rows = Eigen::Matrix<double, Eigen::Dynamic, lanes, Eigen::RowMajor>;

/// y gains A x. Sums of a row stay in registers, which Eigen's own product does not see to.
void add_product(const CompressedRows& A, const Rows& x, Rows& y)
{
  for (PetscInt i = 0; i < A.rows; ++i)
  {
    Eigen::Matrix<double, 1, lanes> sum = Eigen::Matrix<double, 1, lanes>::Zero();
    for (PetscInt k = A.starts[i]; k < A.starts[i + 1]; ++k) sum += A.values[k] * x.row(A.columns[k]);
    y.row(i) += sum;
  }
}

} // namespace

RowType::RowType(std::size_t numbers)
{
  MPI_Type_contiguous(static_cast<int>(numbers), MPI_DOUBLE, &type);
  MPI_Type_commit(&type);
}

RowType::~RowType()
{
  MPI_Type_free(&type);
}

SplitMatrix split(Mat A)
{
  SplitMatrix parts{A};
  PetscBool several = PETSC_FALSE;
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(A), MATMPIAIJ, &several));
  if (!several) return parts;
  const PetscInt* places = nullptr;
  PetscLayout layout = nullptr;
  check(MatMPIAIJGetSeqAIJ(A, &parts.own, &parts.foreign, &places));
  check(MatGetLocalSize(parts.foreign, nullptr, &parts.received));
  check(MatGetLayouts(A, nullptr, &layout));
  check(PetscSFCreate(comm_of(A), parts.exchange.put()));
  check(PetscSFSetGraphLayout(parts.exchange, layout, parts.received, nullptr, PETSC_COPY_VALUES, places));
  return parts;
}

bool is_sparse(Mat A)
{
  PetscBool sparse = PETSC_FALSE;
  check(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(A), &sparse, MATSEQAIJ, MATMPIAIJ, ""));
  return sparse;
}

MatrixXd sparse_product(Mat A, const MatrixXd& X)
{
  const SplitMatrix parts = split(A);
  const CompressedRows own(parts.own);
  const RowType row(lanes);
  MatrixXd Y(own.rows, X.cols());
  Rows x = Rows::Zero(X.rows(), lanes), y(own.rows, lanes), received(parts.received, lanes);
  for (Index first = 0; first < X.cols(); first += lanes)
  {
    const Index count = std::min<Index>(lanes, X.cols() - first);
    x.leftCols(count) = X.middleCols(first, count);
    if (parts.foreign) check(PetscSFBcastBegin(parts.exchange, row.type, x.data(), received.data(), MPI_REPLACE));
    y.setZero();
    add_product(own, x, y);
    if (parts.foreign)
    {
      check(PetscSFBcastEnd(parts.exchange, row.type, x.data(), received.data(), MPI_REPLACE));
      const CompressedRows foreign(parts.foreign);
      add_product(foreign, received, y);
    }
    Y.middleCols(first, count) = y.leftCols(count);
  }
  return Y;
}

} // namespace squeal
