#include "complex_subspace.hpp"

#include "squeal/algebra/dense_matrix.hpp"

namespace squeal
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

ComplexSubspace empty_subspace(const std::array<Mat, 4>& matrices)
{
  const MultiVector none = empty_multivector(matrices[0]);
  ComplexSubspace space{matrices, {}, none, {none, none, none, none}, {}};
  for (std::size_t k = 0; k < 4; ++k)
    if (matrices[k]) check(MatNorm(matrices[k], NORM_1, &space.norms[k]));
  return space;
}

bool extend(ComplexSubspace& space, MultiVector X)
{
  const Index gained = extend_orthonormal(space.V, std::move(X)), size = space.V.columns();
  if (gained == 0) return false;
  const MultiVector W = columns_from(space.V, size - gained);
  for (std::size_t k = 0; k < 4; ++k)
  {
    space.entries[k] = MatrixXd::Zero(size, size);
    if (!space.matrices[k]) continue;
    append(space.images[k], product(space.matrices[k], W));
    space.entries[k] = inner_products(space.V, space.images[k]);
  }
  return true;
}

MultiVector vector_of(const ComplexSubspace& space, const VectorXcd& a)
{
  return combination(space.V, parts_of(a));
}

MultiVector residual_of(const ComplexSubspace& space, const ComplexFactors& factors, const VectorXcd& a,
                        double& backward_error)
{
  MultiVector result{space.V.comm, MatrixXd::Zero(space.V.entries.rows(), 2)};
  double scale = 0;
  for (std::size_t k = 0; k < 4; ++k)
  {
    if (!space.matrices[k]) continue;
    result.entries.noalias() += space.images[k].entries * parts_of(factors[k] * a);
    scale += std::abs(factors[k]) * space.norms[k];
  }
  result.entries /= scale; // |a| = 1, and V is orthonormal
  backward_error = column_norms(result).norm();
  return result;
}

} // namespace squeal
