#pragma once
/// The problem (f_0 M + f_1 C + f_2 K + f_3 K_loss) y = 0, f(lambda) of dense_losses.hpp, on a subspace of real vectors
/// that grows, and what its solutions there leave over in the whole problem. All functions are collective.
#include "squeal/algebra/multivector.hpp"
#include "squeal/modes/dense_losses.hpp"

#include <span>

namespace squeal
{

/// A matrix A of the problem with A V and V'A V, which grow with V. Without a matrix it is zero.
struct Projected
{
  Mat matrix = nullptr; // borrowed
  double norm = 0;      // 1-norm
  MultiVector image{};
  Eigen::MatrixXd entries{};
};

struct Subspace
{
  MultiVector V; // orthonormal
  std::array<Projected, 4> terms{};
};

/// Without vectors yet, of M, C, K and K_loss, which may be null.
Subspace empty_subspace(const std::array<Mat, 4>& matrices);

/// V gains what X adds to its span. Returns whether that is anything.
bool extend(Subspace& space, MultiVector X);

/// V'A V of all terms.
LossyMatrices entries_of(const Subspace& space);

/// V keeps the span of V Q, for an orthonormal Q.
void combine(Subspace& space, const Eigen::MatrixXd& Q);

using Pairs = std::span<const DenseEigenpair>;

/// f_term y of each pair: the real parts of all, then the imaginary parts.
Eigen::MatrixXd coefficients(Pairs pairs, std::size_t term);

/// y = V a of each pair: the real parts of all, then the imaginary parts.
MultiVector vectors_of(const Subspace& space, Pairs pairs);

/// Residuals of pairs V a: the real parts of all, then the imaginary parts.
struct Residuals
{
  MultiVector columns;
  Eigen::VectorXd sizes{}; // of the columns, over the sizes of a pair's terms

  double backward_error(Eigen::Index pair) const { return std::hypot(sizes(pair), sizes(sizes.size() / 2 + pair)); }
};

Residuals residuals_of(const Subspace& space, Pairs pairs);

} // namespace squeal
