#include "subspace.hpp"

namespace squeal
{

using Eigen::Index;
using Eigen::MatrixXd;

namespace
{

/// V has gained its last columns, W: V'A V gains the columns V'(A W) and the rows W'(A V).
void extend(Projected& term, const MultiVector& V, Index gained)
{
  const MultiVector W = columns_from(V, V.columns() - gained), AW = product(term.matrix, W);
  const MatrixXd below = inner_products(W, term.image);
  append(term.image, AW);
  term.entries.conservativeResize(V.columns(), V.columns());
  term.entries.bottomLeftCorner(below.rows(), below.cols()) = below;
  term.entries.rightCols(gained) = inner_products(V, AW);
}

} // namespace

Subspace empty_subspace(const std::array<Mat, 4>& matrices)
{
  Subspace space{empty_multivector(matrices[2])};
  for (std::size_t k = 0; k < matrices.size(); ++k)
  {
    space.terms[k] = {matrices[k], 0, space.V, {}};
    if (matrices[k]) check(MatNorm(matrices[k], NORM_1, &space.terms[k].norm));
  }
  return space;
}

bool extend(Subspace& space, MultiVector X)
{
  PetscInt n = 0;
  check(MatGetSize(space.terms[2].matrix, &n, nullptr));
  if (X.columns() == 0 || space.V.columns() >= n) return false;
  const Index gained = extend_orthonormal(space.V, std::move(X));
  if (gained == 0) return false;
  for (Projected& term : space.terms)
    if (term.matrix) extend(term, space.V, gained);
  return true;
}

LossyMatrices entries_of(const Subspace& space)
{
  LossyMatrices entries;
  for (std::size_t k = 0; k < entries.size(); ++k) entries[k] = space.terms[k].entries;
  return entries;
}

void combine(Subspace& space, const MatrixXd& Q)
{
  space.V = combination(space.V, Q);
  for (Projected& term : space.terms)
    if (term.matrix)
    {
      term.image = combination(term.image, Q);
      term.entries = Q.transpose() * term.entries * Q;
    }
}

MatrixXd coefficients(Pairs pairs, std::size_t term)
{
  const auto count = static_cast<Index>(pairs.size());
  MatrixXd result(pairs.front().y.size(), 2 * count);
  for (Index k = 0; k < count; ++k)
  {
    const auto& [lambda, y] = pairs[static_cast<std::size_t>(k)];
    const Eigen::VectorXcd column = loss_factors(lambda)[term] * y;
    result.col(k) = column.real();
    result.col(count + k) = column.imag();
  }
  return result;
}

MultiVector vectors_of(const Subspace& space, Pairs pairs)
{
  return combination(space.V, coefficients(pairs, 2));
}

Residuals residuals_of(const Subspace& space, Pairs pairs)
{
  const auto count = static_cast<Index>(pairs.size());
  Residuals residuals{{space.V.comm, MatrixXd::Zero(space.V.entries.rows(), 2 * count)}};
  for (std::size_t k = 0; k < space.terms.size(); ++k)
    if (space.terms[k].matrix)
      residuals.columns.entries.noalias() += space.terms[k].image.entries * coefficients(pairs, k);
  residuals.sizes = column_norms(residuals.columns);
  for (Index pair = 0; pair < count; ++pair)
  {
    const ComplexFactors factors = loss_factors(pairs[static_cast<std::size_t>(pair)].lambda);
    double scale = 0;
    for (std::size_t k = 0; k < factors.size(); ++k) scale += std::abs(factors[k]) * space.terms[k].norm;
    for (const Index column : {pair, count + pair}) residuals.sizes(column) /= scale;
  }
  return residuals;
}

} // namespace squeal
