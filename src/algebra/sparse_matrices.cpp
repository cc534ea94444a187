#include "squeal/algebra/sparse_matrices.hpp"
#include "squeal/algebra/panel.hpp"
#include "squeal/base/dense.hpp"

#include <algorithm>
#include <petscsf.h>

namespace squeal
{

namespace
{

using Two = double __attribute__((vector_size(16)));

/// Entries of both matrices at x_j = (v_j, u_j). Without fused products, so that K u of a body that moves without
/// strain is zero to the last bit.
Two entry_times(const std::array<double, 2>& value, const Two* x)
{
  Two entry;
  std::memcpy(&entry, &value, sizeof entry);
  return entry * *x;
}

/// y += A x of this rank's own columns, which are stored from the diagonal on.
void add_own(const PairedRows& matrices, const Two* x, Two* y)
{
  for (std::size_t i = 0; i + 1 < matrices.starts.size(); ++i)
  {
    const auto first = static_cast<std::size_t>(matrices.starts[i]),
               end = static_cast<std::size_t>(matrices.starts[i + 1]);
    Two sum = y[i] + entry_times(matrices.values[first], x + i);
    for (std::size_t k = first + 1; k < end; ++k)
    {
      const PetscInt j = matrices.columns[k];
      sum += entry_times(matrices.values[k], x + j);
      y[j] += entry_times(matrices.values[k], x + i);
    }
    y[i] = sum;
  }
}

/// y += A x of other ranks' columns.
void add_foreign(const PairedRows& matrices, const Two* x, Two* y)
{
  for (std::size_t i = 0; i + 1 < matrices.starts.size(); ++i)
    for (auto k = static_cast<std::size_t>(matrices.starts[i]); k < static_cast<std::size_t>(matrices.starts[i + 1]);
         ++k)
      y[i] += entry_times(matrices.values[k], x + matrices.columns[k]);
}

/// Appends row i of two matrices of one pattern, from a column on; whether it has that column.
bool append_row(const CompressedRows& M, const CompressedRows& K, PetscInt i, PetscInt first, PairedRows& rows)
{
  const std::size_t before = rows.columns.size();
  for (PetscInt k = M.starts[i]; k < M.starts[i + 1]; ++k)
  {
    if (M.columns[k] < first) continue;
    rows.columns.push_back(M.columns[k]);
    rows.values.push_back({M.values[k], K.values[k]});
  }
  rows.starts.push_back(static_cast<PetscInt>(rows.columns.size()));
  return rows.columns.size() > before && rows.columns[before] == first;
}

bool have_one_pattern(const CompressedRows& M, const CompressedRows& K)
{
  return std::equal(M.starts, M.starts + M.rows + 1, K.starts) &&
         std::equal(M.columns, M.columns + M.starts[M.rows], K.columns);
}

} // namespace

std::optional<PairedMatrices> pair_matrices(Mat M, Mat K)
{
  if (!is_sparse(M) || !is_sparse(K)) return std::nullopt;
  SplitMatrix of_M = split(M);
  const SplitMatrix of_K = split(K);
  PairedMatrices matrices{comm_of(M), {}, {}, static_cast<std::size_t>(of_M.received), {}};
  int alike = 1; // on all ranks
  const auto join = [&](Mat left, Mat right, PairedRows& rows, bool upper)
  {
    const CompressedRows m(left), k(right);
    alike = alike && have_one_pattern(m, k);
    for (PetscInt i = 0; alike && i < m.rows; ++i)
      alike = append_row(m, k, i, upper ? i : 0, rows) || !upper; // a row begins with its diagonal entry
  };
  join(of_M.own, of_K.own, matrices.own, true);
  if (of_M.foreign) join(of_M.foreign, of_K.foreign, matrices.foreign, false);
  MPI_Allreduce(MPI_IN_PLACE, &alike, 1, MPI_INT, MPI_LAND, matrices.comm);
  if (!alike) return std::nullopt;
  matrices.exchange = std::move(of_M.exchange);
  return matrices;
}

void multiply_both(const PairedMatrices& matrices, const std::array<Vec, 2>& of, const std::array<Vec, 2>& to)
{
  const std::size_t rows = matrices.own.starts.size() - 1;
  std::vector<Two> x(rows), y(rows, Two{}), z(matrices.received);
  for (std::size_t part = 0; part < 2; ++part)
  {
    const PetscScalar* from = nullptr;
    check(VecGetArrayRead(of[part], &from));
    for (std::size_t i = 0; i < rows; ++i) x[i][part] = from[i];
    check(VecRestoreArrayRead(of[part], &from));
  }
  add_own(matrices.own, x.data(), y.data());
  if (ranks_of(matrices.comm) > 1)
  {
    const RowType row(2);
    check(PetscSFBcastBegin(matrices.exchange, row.type, x.data(), z.data(), MPI_REPLACE));
    check(PetscSFBcastEnd(matrices.exchange, row.type, x.data(), z.data(), MPI_REPLACE));
    add_foreign(matrices.foreign, z.data(), y.data());
  }
  for (std::size_t part = 0; part < 2; ++part)
  {
    PetscScalar* result = nullptr;
    check(VecGetArrayWrite(to[part], &result));
    for (std::size_t i = 0; i < rows; ++i) result[i] = y[i][part];
    check(VecRestoreArrayWrite(to[part], &result));
  }
}

namespace
{

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

void quadratic_residual(const QuadraticMatrices& A, std::complex<double> lambda, ComplexVector y,
                        ComplexVector residual)
{
  const auto [real, imaginary] = residual;
  const std::complex<double> square = lambda * lambda;
  const Owned<Vec> a = zeros_like(real), b = zeros_like(real);
  check(MatMult(A.K, y.real, real));
  check(MatMult(A.K, y.imaginary, imaginary));
  for (const auto& [matrix, factor] : {std::pair{A.C, lambda}, std::pair{A.M, square}})
  {
    check(MatMult(matrix, y.real, a));
    check(MatMult(matrix, y.imaginary, b));
    check(VecAXPBYPCZ(real, factor.real(), -factor.imag(), 1, a, b));
    check(VecAXPBYPCZ(imaginary, factor.imag(), factor.real(), 1, a, b));
  }
}

} // namespace squeal
