#include "squeal/modes/two_sided.hpp"

#include "subspace.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/SVD>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::MatrixXcd;

constexpr double two_sided_tolerance = 1e-13; // backward error: derivatives are off by it to first order
constexpr double near = 1e-6;                 // backward errors from which on lambda follows the vectors
constexpr int two_sided_passes = 60;          // each adds two vectors to a side, with which small problems stay small
constexpr double beside = 1e-4; // of tau from -Re(lambda^2), which is an eigenvalue of the pencil without damping

/// The vector that the problem on the subspace takes nearest to zero.
DenseEigenpair null_vector(const Subspace& space, Complex lambda)
{
  const Eigen::BDCSVD<MatrixXcd> svd(sum(entries_of(space), loss_factors(lambda)), Eigen::ComputeFullV);
  return {lambda, svd.matrixV().col(svd.matrixV().cols() - 1)};
}

/// x'y without conjugation, of real and imaginary parts.
Complex bilinear(const MultiVector& x, const MultiVector& y)
{
  const Eigen::MatrixXd products = inner_products(x, y);
  return {products(0, 0) - products(1, 1), products(0, 1) + products(1, 0)};
}

/// By the two-sided Rayleigh quotient.
Complex change_of_lambda(const Subspace& space, Complex lambda, const MultiVector& left, const MultiVector& right)
{
  std::array<Complex, 4> products{};
  Complex residual = 0;
  const ComplexFactors factor = loss_factors(lambda);
  for (std::size_t k = 0; k < 4; ++k)
    if (space.terms[k].matrix)
    {
      products[k] = bilinear(left, product(space.terms[k].matrix, right));
      residual += factor[k] * products[k];
    }
  return -residual / (2. * lambda * products[0] + products[1]);
}

} // namespace

TwoSidedProblem make_two_sided(const QuadraticProblem& matrices, Mat K_loss, const PencilOptions& options)
{
  return {matrices,
          K_loss,
          transpose_of(matrices.M),
          transpose_of(matrices.C),
          transpose_of(matrices.K),
          K_loss ? transpose_of(K_loss) : Owned<Mat>{},
          make_shift_invert(matrices.K, matrices.M, Symmetry::none, options)};
}

TwoSidedMode find_two_sided(TwoSidedProblem& problem, Complex lambda, const MultiVector& start)
{
  const auto& [M, C, K] = problem.matrices;
  move_to(problem.pencil, -(1 + beside) * (lambda * lambda).real());
  const PencilFactor& P = *problem.pencil.factor;
  Subspace right = empty_subspace({M, C, K, problem.K_loss}),
           left = empty_subspace({problem.M_t, problem.C_t, problem.K_t, problem.K_loss_t});
  extend(right, start);
  extend(left, P.solve_transposed(product(problem.M_t, start)));
  TwoSidedMode mode{lambda, {}, {}, HUGE_VAL};
  for (int pass = 0;; ++pass)
  {
    DenseEigenpair y = null_vector(right, mode.lambda), x = null_vector(left, mode.lambda);
    mode.right = vectors_of(right, {&y, 1});
    mode.left = vectors_of(left, {&x, 1});
    const bool follows = mode.backward_error < near;
    if (follows) mode.lambda += change_of_lambda(right, mode.lambda, mode.left, mode.right);
    if (lambda.imag() == 0) mode.lambda.imag(0);
    y.lambda = x.lambda = mode.lambda;
    const Residuals r = residuals_of(right, {&y, 1}), s = residuals_of(left, {&x, 1});
    const double of_right = r.backward_error(0), of_left = s.backward_error(0);
    mode.backward_error = std::max(of_right, of_left);
    if ((follows && mode.backward_error <= two_sided_tolerance) || pass == two_sided_passes) return mode;
    const bool wider_right = of_right > two_sided_tolerance && extend(right, P.solve(r.columns)),
               wider_left = of_left > two_sided_tolerance && extend(left, P.solve_transposed(s.columns));
    if (!wider_right && !wider_left && follows) return mode;
  }
}

} // namespace squeal
