#include "squeal/analysis/complex_block.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

using Index = std::size_t;
using Eigen::MatrixXcd, Eigen::MatrixXd;

// [re im], so that another block is read once for both.
Block beside(const ComplexBlock& X)
{
  Block both = X.re;
  append(both, X.im);
  return both;
}

MatrixXd inner_matrix(const Block& X, const Block& Y)
{
  const std::vector<double> entries = inner(X, Y);
  return Eigen::Map<const MatrixXd>(entries.data(), X.columns, Y.columns);
}

std::vector<double> beside(const MatrixXd& a, const MatrixXd& b)
{
  std::vector<double> both(a.data(), a.data() + a.size());
  both.insert(both.end(), b.data(), b.data() + b.size());
  return both;
}

Block zeros(const Block& X, PetscInt columns)
{
  return {X.comm, X.rows, columns, std::vector<double>(static_cast<Index>(X.rows) * static_cast<Index>(columns), 0.)};
}

ComplexBlock zeros(const ComplexBlock& X, PetscInt columns)
{
  return {zeros(X.re, columns), zeros(X.im, columns)};
}

ComplexBlock column_of(const ComplexBlock& X, PetscInt j)
{
  const auto one = [&](const Block& part) {
    return Block{part.comm, part.rows, 1, {part.column(j), part.column(j + 1)}};
  };
  return {one(X.re), one(X.im)};
}

double norm_of(const ComplexBlock& x)
{
  return std::hypot(column_norms(x.re)[0], column_norms(x.im)[0]);
}

// X -= V V* X; returns V* X.
MatrixXcd deflate(ComplexBlock& X, const ComplexBlock& V)
{
  const MatrixXcd part = inner(V, X);
  add_combination(X, V, -part);
  return part;
}

void append(ComplexBlock& X, const ComplexBlock& Y)
{
  append(X.re, Y.re);
  append(X.im, Y.im);
}

Block rows_of(const Block& Z, PetscInt first, PetscInt count)
{
  Block X{Z.comm, count, Z.columns, {}};
  for (PetscInt j = 0; j < Z.columns; ++j)
    X.entries.insert(X.entries.end(), Z.column(j) + first, Z.column(j) + first + count);
  return X;
}

} // namespace

ComplexBlock product(Mat A, const ComplexBlock& X)
{
  return {product(A, X.re), product(A, X.im)};
}

MatrixXcd inner(const ComplexBlock& X, const ComplexBlock& Y)
{
  const Block both = beside(Y);
  const MatrixXd re = inner_matrix(X.re, both), im = inner_matrix(X.im, both);
  const Eigen::Index columns = Y.columns();
  MatrixXcd result(X.columns(), columns);
  result.real() = re.leftCols(columns) + im.rightCols(columns);
  result.imag() = re.rightCols(columns) - im.leftCols(columns);
  return result;
}

void add_combination(ComplexBlock& Y, const ComplexBlock& X, const MatrixXcd& a)
{
  Block both = beside(Y);
  add_combination(both, 1, X.re, beside(a.real(), a.imag()));
  add_combination(both, 1, X.im, beside(-a.imag(), a.real()));
  const auto half = both.entries.begin() + static_cast<std::ptrdiff_t>(Y.re.entries.size());
  Y.re.entries.assign(both.entries.begin(), half);
  Y.im.entries.assign(half, both.entries.end());
}

void add(ComplexBlock& Y, std::complex<double> alpha, const ComplexBlock& X)
{
  for (Index i = 0; i < Y.re.entries.size(); ++i)
  {
    const std::complex<double> term = alpha * std::complex<double>(X.re.entries[i], X.im.entries[i]);
    Y.re.entries[i] += term.real();
    Y.im.entries[i] += term.imag();
  }
}

ComplexBlock combination(const ComplexBlock& X, const MatrixXcd& a)
{
  ComplexBlock Y = zeros(X, static_cast<PetscInt>(a.cols()));
  add_combination(Y, X, a);
  return Y;
}

ComplexBlock columns_from(const ComplexBlock& X, PetscInt first)
{
  return {columns_from(X.re, first), columns_from(X.im, first)};
}

// Against V all at once and twice, which is enough; against each other one by one, and a column of which little was
// left meets V again.
MatrixXcd extend_orthonormal(ComplexBlock& V, ComplexBlock X)
{
  constexpr double nothing = 1e-13, little = 1e-2;
  std::vector<double> sizes;
  for (PetscInt j = 0; j < X.columns(); ++j) sizes.push_back(norm_of(column_of(X, j)));
  MatrixXcd inside = deflate(X, V);
  inside += deflate(X, V);
  ComplexBlock W = zeros(X, 0);
  for (PetscInt j = 0; j < X.columns(); ++j)
  {
    ComplexBlock x = column_of(X, j);
    const double before = norm_of(x), least = nothing * sizes[static_cast<Index>(j)];
    double left = before;
    for (int pass = 0; pass < 3 && left > least; ++pass)
    {
      if (pass > 0 && left < little * before) deflate(x, V);
      deflate(x, W);
      left = norm_of(x);
    }
    if (!(left > least)) continue;
    ComplexBlock unit = zeros(x, 1);
    add(unit, 1 / left, x);
    append(W, unit);
  }
  append(V, W);
  MatrixXcd all(V.columns(), X.columns());
  all << inside, inner(W, X);
  return all;
}

ComplexBlock upper_half(const ComplexBlock& Z)
{
  const PetscInt half = Z.re.rows / 2;
  return {rows_of(Z.re, 0, half), rows_of(Z.im, 0, half)};
}

ComplexBlock lower_half(const ComplexBlock& Z)
{
  const PetscInt half = Z.re.rows / 2;
  return {rows_of(Z.re, half, half), rows_of(Z.im, half, half)};
}

ComplexBlock stacked(const ComplexBlock& upper, const ComplexBlock& lower)
{
  const auto stack = [](const Block& a, const Block& b)
  {
    Block Z{a.comm, a.rows + b.rows, a.columns, {}};
    for (PetscInt j = 0; j < a.columns; ++j)
    {
      Z.entries.insert(Z.entries.end(), a.column(j), a.column(j + 1));
      Z.entries.insert(Z.entries.end(), b.column(j), b.column(j + 1));
    }
    return Z;
  };
  return {stack(upper.re, lower.re), stack(upper.im, lower.im)};
}

} // namespace squeal
