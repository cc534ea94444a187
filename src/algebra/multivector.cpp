#include "squeal/algebra/multivector.hpp"
#include "registers.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/algebra/panel.hpp"
#include "squeal/algebra/sparse_matrices.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/statistics.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

/// A sum over all ranks may differ in the last bit from rank to rank: rank 0 adds up.
void add_up(MatrixXd& parts, MPI_Comm comm)
{
  const int size = to_int(parts.size());
  const bool here = rank_of(comm) == 0;
  MPI_Reduce(here ? MPI_IN_PLACE : parts.data(), parts.data(), size, MPI_DOUBLE, MPI_SUM, 0, comm);
  MPI_Bcast(parts.data(), size, MPI_DOUBLE, 0, comm);
}

void set_column(MultiVector& X, Index j, Vec x)
{
  const PetscScalar* values = nullptr;
  check(VecGetArrayRead(x, &values));
  X.entries.col(j) = VectorXd::Map(values, X.entries.rows());
  check(VecRestoreArrayRead(x, &values));
}

/// A X column by column, for a dense A or for few columns. Then an exchange of them together, which takes a dozen
/// messages to prepare, costs more than to read A again.
void multiply_few(Mat A, const MultiVector& X, MultiVector& Y)
{
  const Owned<Vec> x = vector_of_columns(A), y = vector_of_rows(A);
  for (Index j = 0; j < X.columns(); ++j)
  {
    copy_column(X, j, x);
    check(MatMult(A, x, y));
    set_column(Y, j, y);
  }
}

/// Drops the columns with a norm of `least` or below; returns the norms of the others.
VectorXd drop_columns(MultiVector& X, double least)
{
  const VectorXd norms = column_norms(X);
  std::vector<Index> kept;
  for (Index j = 0; j < norms.size(); ++j)
    if (norms(j) > least) kept.push_back(j);
  if (static_cast<Index>(kept.size()) < norms.size()) X.entries = X.entries(Eigen::all, kept).eval();
  return norms(kept);
}

/// Scales the columns to unit length and drops those of zeros.
void normalise_columns(MultiVector& X)
{
  const VectorXd norms = drop_columns(X, 0);
  X.entries.array().rowwise() /= norms.transpose().array();
}

/// A number in (-1, 1).
double pseudo_random(std::uint64_t seed)
{
  return static_cast<double>(splitmix64(seed) >> 11) * 0x1p-52 - 1;
}

} // namespace

MultiVector empty_multivector(Mat A)
{
  return {comm_of(A), MatrixXd(own_columns(A).size(), 0)};
}

MultiVector random_multivector(Mat A, PetscInt columns)
{
  const IndexRange own = own_columns(A);
  const auto entry = [&](Index i, Index j)
  { return pseudo_random(0x9e3779b97f4a7c15u * static_cast<std::uint64_t>((own.first + i) * columns + j + 1)); };
  return {comm_of(A), MatrixXd::NullaryExpr(own.size(), columns, entry)};
}

MultiVector columns_of(std::span<const Vec> x)
{
  MultiVector X{comm_of(x[0]), MatrixXd(own_range(x[0]).size(), x.size())};
  for (Index j = 0; j < X.columns(); ++j) set_column(X, j, x[static_cast<std::size_t>(j)]);
  return X;
}

void append(MultiVector& X, Vec x)
{
  X.entries.conservativeResize(Eigen::NoChange, X.columns() + 1);
  set_column(X, X.columns() - 1, x);
}

void append(MultiVector& X, const MultiVector& Y)
{
  X.entries.conservativeResize(Eigen::NoChange, X.columns() + Y.columns());
  X.entries.rightCols(Y.columns()) = Y.entries;
}

void copy_column(const MultiVector& X, Index j, Vec x)
{
  PetscScalar* values = nullptr;
  check(VecGetArrayWrite(x, &values));
  VectorXd::Map(values, X.entries.rows()) = X.entries.col(j);
  check(VecRestoreArrayWrite(x, &values));
}

MultiVector product(Mat A, const MultiVector& X)
{
  MultiVector Y{X.comm, MatrixXd(own_rows(A).size(), X.columns())};
  if (X.columns() <= 2 || !is_sparse(A))
  {
    multiply_few(A, X, Y);
    return Y;
  }
  Y.entries = sparse_product(A, X.entries);
  return Y;
}

MatrixXd whole_product(Mat A, const MultiVector& X)
{
  const MultiVector own = product(A, X);
  MatrixXd whole = MatrixXd::Zero(row_count(A), X.columns());
  whole.middleRows(own_rows(A).first, own.entries.rows()) = own.entries;
  add_up(whole, X.comm);
  return whole;
}

void product(Mat A, std::span<const Vec> x, std::span<const Vec> y)
{
  if (x.size() == 1)
  {
    check(MatMult(A, x[0], y[0]));
    return;
  }
  const MultiVector Y = product(A, columns_of(x));
  for (std::size_t k = 0; k < y.size(); ++k) copy_column(Y, static_cast<Index>(k), y[k]);
}

MultiVector combination(const MultiVector& X, const MatrixXd& a)
{
  return {X.comm, X.entries * a};
}

void combine(MultiVector& X, const MatrixXd& a)
{
  constexpr Index height = 512; // rows at once
  MatrixXd part;
  for (Index i = 0; i < X.entries.rows(); i += height)
  {
    part.noalias() = X.entries.middleRows(i, std::min(height, X.entries.rows() - i)) * a;
    X.entries.block(i, 0, part.rows(), part.cols()) = part;
  }
  X.entries.conservativeResize(Eigen::NoChange, a.cols());
}

MultiVector columns_from(const MultiVector& X, Index first)
{
  return {X.comm, X.entries.rightCols(X.columns() - first)};
}

MatrixXd inner_products(const MultiVector& X, const MultiVector& Y)
{
  MatrixXd result = X.entries.transpose() * Y.entries;
  add_up(result, X.comm);
  return result;
}

namespace
{

/// X'Y of a symmetric result, by blocks of Y's columns: `block_of` gives so many from a place on. What is above the
/// blocks of the diagonal is left out.
template <class Block> MatrixXd symmetric_by_blocks(const MultiVector& X, Block block_of)
{
  constexpr Index width = 128;
  const Index size = X.columns();
  MatrixXd result = MatrixXd::Zero(size, size);
  for (Index j = 0; j < size; j += width)
  {
    const Index count = std::min(width, size - j);
    result.block(j, j, size - j, count).noalias() = X.entries.rightCols(size - j).transpose() * block_of(j, count);
  }
  add_up(result, X.comm);
  result.triangularView<Eigen::StrictlyUpper>() = result.transpose();
  return result;
}

} // namespace

MatrixXd symmetric_inner_products(const MultiVector& X, const MultiVector& Y)
{
  return symmetric_by_blocks(X, [&](Index first, Index count) { return Y.entries.middleCols(first, count); });
}

MatrixXd symmetric_inner_products(const MultiVector& X, Mat A,
                                  const std::function<void(Index first, const MultiVector& image)>& visit)
{
  return symmetric_by_blocks(X,
                             [&](Index first, Index count)
                             {
                               MultiVector image = product(A, {X.comm, X.entries.middleCols(first, count)});
                               if (visit) visit(first, image);
                               return std::move(image.entries);
                             });
}

VectorXd column_norms(const MultiVector& X)
{
  VectorXd squares = X.entries.colwise().squaredNorm();
  MPI_Allreduce(MPI_IN_PLACE, squares.data(), to_int(squares.size()), MPI_DOUBLE, MPI_SUM, X.comm);
  return squares.cwiseSqrt();
}

void orthonormalise(MultiVector& X, double least)
{
  if (X.columns() == 0) return;
  const auto [values, vectors] = solve_dense_symmetric(inner_products(X, X));
  const Index kept = (values.array() > least * values(values.size() - 1)).count();
  const VectorXd scale = values.tail(kept).cwiseSqrt().cwiseInverse();
  X = combination(X, vectors.rightCols(kept) * scale.asDiagonal());
}

Index extend_orthonormal(MultiVector& V, MultiVector X)
{
  constexpr double nothing = 1e-12, rounding = 1e-13;
  const Index before = V.columns();
  normalise_columns(X);
  // A round appends the directions above 3e-7 of the largest; smaller ones are left to the next rounds.
  for (int round = 0; round < 4 && X.columns() > 0; ++round)
  {
    X.entries.noalias() -= V.entries * inner_products(V, X);
    drop_columns(X, nothing);
    MultiVector Y = X;
    normalise_columns(Y);
    if (Y.columns() == 0) break;
    orthonormalise(Y, rounding);
    Y.entries.noalias() -= V.entries * inner_products(V, Y); // the rounding of small columns has grown by scaling
    drop_columns(Y, 0.5);
    if (Y.columns() == 0) break;
    normalise_columns(Y);
    orthonormalise(Y, rounding);
    append(V, Y);
    if (Y.columns() == X.columns()) break;
  }
  return V.columns() - before;
}

// Products with dense matrices for several right-hand sides.

namespace
{

/// Adds the products with eight columns of W and, transposed, with their part below the diagonal block.
SQUEAL_INLINE void add_columns(const double* W, std::size_t size, std::size_t j, const double* __restrict x,
                               double* __restrict y)
{
  const double* const first = W + j * size;
  for (std::size_t k = 0; k < tile; ++k)
    for (std::size_t i = j; i < j + tile; ++i)
      y[j + k] += first[std::min(k, i - j) * size + j + std::max(k, i - j)] * x[i];
  constexpr std::size_t some = taken<Four>;
  Four sums[tile] = {}, some_W, some_x, some_y;
  std::size_t i = j + tile;
  for (; i + some <= size; i += some)
  {
    get(x + i, some_x);
    get(y + i, some_y);
    for (std::size_t k = 0; k < tile; ++k)
    {
      get(first + k * size + i, some_W);
      some_y += some_W * x[j + k];
      sums[k] += some_W * some_x;
    }
    put(some_y, y + i);
  }
  for (std::size_t k = 0; k < tile; ++k)
  {
    for (std::size_t part = 0; part < some; ++part) y[j + k] += sums[k][part];
    for (std::size_t row = i; row < size; ++row)
    {
      y[row] += first[k * size + row] * x[j + k];
      y[j + k] += first[k * size + row] * x[row];
    }
  }
}

} // namespace

SQUEAL_SIMD void add_symmetric_product(const double* W, std::size_t size, std::size_t columns, const double* x,
                                       double* y)
{
  std::size_t j = 0;
  for (; j + tile <= columns; j += tile) add_columns(W, size, j, x, y);
  for (; j < columns; ++j)
  {
    const double* const column = W + j * size;
    y[j] += column[j] * x[j];
    for (std::size_t i = j + 1; i < size; ++i)
    {
      y[i] += column[i] * x[j];
      y[j] += column[i] * x[i];
    }
  }
}

} // namespace squeal
