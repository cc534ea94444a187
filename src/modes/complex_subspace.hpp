#pragma once
/// The problem (f_0 M + f_1 C + f_2 K + f_3 K_loss) y = 0 with complex factors f on a subspace of real vectors, and
/// what its solutions there leave over in the whole problem.
#include "squeal/algebra/multivector.hpp"
#include "squeal/modes/dense_losses.hpp"

namespace squeal
{

/// The matrices on an orthonormal V, with their products A V. K_loss may be null, and is zero then.
struct ComplexSubspace
{
  std::array<Mat, 4> matrices{}; // borrowed
  std::array<double, 4> norms{}; // 1-norms
  MultiVector V;
  std::array<MultiVector, 4> images{};
  LossyMatrices entries{}; // V'A V
};

/// Without vectors yet. Collective.
ComplexSubspace empty_subspace(const std::array<Mat, 4>& matrices);

/// V gains what X adds to its span. Returns whether that is anything. Collective.
bool extend(ComplexSubspace& space, MultiVector X);

/// Real and imaginary part of y = V a.
MultiVector vector_of(const ComplexSubspace& space, const Eigen::VectorXcd& a);

/// The residual of V a in the whole problem, its real and imaginary part, over the sizes of its terms; |a| = 1.
/// Collective.
MultiVector residual_of(const ComplexSubspace& space, const ComplexFactors& factors, const Eigen::VectorXcd& a,
                        double& backward_error);

} // namespace squeal
