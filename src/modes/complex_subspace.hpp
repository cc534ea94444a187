#pragma once
/// The problem (f_0 M + f_1 C + f_2 K + f_3 K_loss) y = 0 with complex factors f on a subspace of real vectors, and
/// what its solutions there leave over in the whole problem.
#include "squeal/algebra/multivector.hpp"
#include "squeal/modes/two_sided.hpp"

#include <array>
#include <complex>

namespace squeal
{

/// Of M, C, K and K_loss.
using ComplexFactors = std::array<std::complex<double>, 4>;

/// The matrices on an orthonormal V, with their products A V. K_loss may be null, and is zero then.
struct ComplexSubspace
{
  std::array<Mat, 4> matrices{}; // borrowed
  std::array<double, 4> norms{}; // 1-norms
  MultiVector V;
  std::array<MultiVector, 4> images{};
  std::array<Eigen::MatrixXd, 4> entries{}; // V'A V
};

/// At lambda, f_3 by what loss factors are in the mode.
ComplexFactors loss_factors(LossKind kind, std::complex<double> lambda);

/// Without vectors yet. Collective.
ComplexSubspace empty_subspace(const std::array<Mat, 4>& matrices);

/// V gains what X adds to its span. Returns whether that is anything. Collective.
bool extend(ComplexSubspace& space, MultiVector X);

/// The sum of f_k A_k.
Eigen::MatrixXcd sum(const std::array<Eigen::MatrixXd, 4>& A, const ComplexFactors& factors);

/// Real and imaginary part of y = V a.
MultiVector vector_of(const ComplexSubspace& space, const Eigen::VectorXcd& a);

/// The residual of V a in the whole problem, its real and imaginary part, over the sizes of its terms; |a| = 1.
/// Collective.
MultiVector residual_of(const ComplexSubspace& space, const ComplexFactors& factors, const Eigen::VectorXcd& a,
                        double& backward_error);

} // namespace squeal
