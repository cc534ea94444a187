#include "sparse_product.hpp"

#include "registers.hpp"

#include <algorithm>
#include <petscsf.h>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

constexpr std::size_t lanes = 16; // columns at once

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

/// y += A x for `lanes` columns, side by side in each row of x and y.
SQUEAL_SIMD void add_product(const CompressedRows& A, const double* x, double* y)
{
  constexpr std::size_t width = sizeof(Four) / sizeof(double), vectors = lanes / width;
  Four sums[vectors], other;
  for (PetscInt i = 0; i < A.rows; ++i)
  {
    double* const row = y + static_cast<std::size_t>(i) * lanes;
    std::memcpy(sums, row, sizeof sums);
    for (PetscInt k = A.starts[i]; k < A.starts[i + 1]; ++k)
    {
      const double* const from = x + static_cast<std::size_t>(A.columns[k]) * lanes;
      for (std::size_t n = 0; n < vectors; ++n)
      {
        std::memcpy(&other, from + n * width, sizeof other);
        sums[n] += A.values[k] * other;
      }
    }
    std::memcpy(row, sums, sizeof sums);
  }
}

/// The part of A on this rank's columns, and that on other ranks' with the exchange of their rows.
struct SplitMatrix
{
  Mat own = nullptr, foreign = nullptr; // foreign: null of SEQAIJ
  PetscInt received = 0;
  Owned<PetscSF> exchange{};
};

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

bool is_sparse(Mat A)
{
  PetscBool sparse = PETSC_FALSE;
  check(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(A), &sparse, MATSEQAIJ, MATMPIAIJ, ""));
  return sparse;
}

MatrixXd sparse_product(Mat A, const MatrixXd& X)
{
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, static_cast<int>(lanes), Eigen::RowMajor>;
  const SplitMatrix parts = split(A);
  const CompressedRows own(parts.own);
  const RowType row(lanes);
  MatrixXd Y(own.rows, X.cols());
  Rows x = Rows::Zero(X.rows(), lanes), y, received(parts.received, lanes);
  for (Index first = 0; first < X.cols(); first += static_cast<Index>(lanes))
  {
    const Index count = std::min(static_cast<Index>(lanes), X.cols() - first);
    x.leftCols(count) = X.middleCols(first, count);
    y.setZero(own.rows, lanes);
    if (parts.foreign) check(PetscSFBcastBegin(parts.exchange, row.type, x.data(), received.data(), MPI_REPLACE));
    add_product(own, x.data(), y.data());
    if (parts.foreign)
    {
      check(PetscSFBcastEnd(parts.exchange, row.type, x.data(), received.data(), MPI_REPLACE));
      add_product(CompressedRows(parts.foreign), received.data(), y.data());
    }
    Y.middleCols(first, count) = y.leftCols(count);
  }
  return Y;
}

} // namespace squeal
