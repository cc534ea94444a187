#pragma once
/// Dense quadratic eigenproblems with loss factors (src/README.md, section 3.11):
///     Q(lambda) y = 0,   Q = lambda^2 M + lambda C + K + f K_loss
/// f is i, of complex stiffness K + i K_loss, where lambda oscillates (Im(lambda) > 0); 0 of a real lambda. Matrices
/// are square, of one size and not symmetric in general. An empty K_loss is zero. Functions whose name ends in _shared
/// are collective and take the matrices of rank 0.
#include "squeal/algebra/dense_eigenproblems.hpp"

#include <array>

namespace squeal
{

/// f
std::complex<double> loss_factor_of(std::complex<double> lambda);

/// Of M, C, K and K_loss.
using ComplexFactors = std::array<std::complex<double>, 4>;

/// lambda^2, lambda, 1 and f
ComplexFactors loss_factors(std::complex<double> lambda);

/// M, C, K and K_loss.
using LossyMatrices = std::array<Eigen::MatrixXd, 4>;

/// The sum of f_k A_k.
Eigen::MatrixXcd sum(const LossyMatrices& A, const ComplexFactors& factors);

/// All pairs with Im(lambda) >= 0. Those that are real without K_loss stay as they are. Collective.
std::vector<DenseEigenpair> solve_lossy_shared(MPI_Comm comm, const LossyMatrices& problem);

/// Eigenpairs with |lambda| <= limit, with both vectors. Collective.
std::vector<TwoSidedPair> solve_two_sided_lossy_shared(MPI_Comm comm, const LossyMatrices& problem, double limit);

} // namespace squeal
