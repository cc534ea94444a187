#include "sparse_product.hpp"

#include <algorithm>
#include <Eigen/SparseCore>
#include <petscsf.h>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int lanes = 16; // columns at once

/// Rows of A for a product; they end with `A`.
Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor, PetscInt>> as_eigen(const CompressedRows& A,
                                                                                  Index columns)
{
  return {A.rows, columns, A.starts[A.rows], A.starts, A.columns, A.values};
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
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, lanes, Eigen::RowMajor>;
  const SplitMatrix parts = split(A);
  const CompressedRows own(parts.own);
  const RowType row(lanes);
  MatrixXd Y(own.rows, X.cols());
  Rows x = Rows::Zero(X.rows(), lanes), y, received(parts.received, lanes);
  for (Index first = 0; first < X.cols(); first += lanes)
  {
    const Index count = std::min<Index>(lanes, X.cols() - first);
    x.leftCols(count) = X.middleCols(first, count);
    if (parts.foreign) check(PetscSFBcastBegin(parts.exchange, row.type, x.data(), received.data(), MPI_REPLACE));
    y = as_eigen(own, x.rows()) * x;
    if (parts.foreign)
    {
      check(PetscSFBcastEnd(parts.exchange, row.type, x.data(), received.data(), MPI_REPLACE));
      const CompressedRows foreign(parts.foreign);
      y += as_eigen(foreign, received.rows()) * received;
    }
    Y.middleCols(first, count) = y.leftCols(count);
  }
  return Y;
}

} // namespace squeal
