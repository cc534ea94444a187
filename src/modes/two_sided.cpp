#include "squeal/modes/two_sided.hpp"

#include "squeal/modes/dense_losses.hpp"
#include "squeal/modes/passes.hpp"

#include <cmath>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;

constexpr double two_sided_tolerance = 1e-13; // backward error: derivatives are off by it to first order
constexpr int two_sided_passes = 60;          // each adds two vectors to a side, with which small problems stay small
constexpr double beside = 1e-4; // of tau from -Re(lambda^2), which is an eigenvalue of the pencil without damping

/// The pair nearest lambda, from a first vector.
Eigenpair nearest_pair(const QuadraticProblem& problem, Mat K_loss, const MultiVector& start, const PencilFactor& P,
                       Complex lambda)
{
  constexpr double lowest = 0.7, highest = 1.4; // of |lambda|
  const double square = std::norm(lambda);
  QuadraticSolution found = solve_on_subspace(problem, lambda.imag() == 0 ? nullptr : K_loss, start, &P,
                                              {.window = {lowest * lowest * square, highest * highest * square},
                                               .passes = two_sided_passes,
                                               .pairs = 1,
                                               .tolerance = two_sided_tolerance,
                                               .sharp = two_sided_tolerance,
                                               .near = lambda});
  Eigenpair nearest{HUGE_VAL, {}, {}, HUGE_VAL};
  for (Eigenpair& pair : found.pairs)
    if (std::abs(pair.lambda - lambda) < std::abs(nearest.lambda - lambda)) nearest = std::move(pair);
  return nearest;
}

MultiVector parts_of(const Eigenpair& pair)
{
  return columns_of(std::array{pair.real.get(), pair.imaginary.get()});
}

/// By the two-sided Rayleigh quotient.
Complex change_of_lambda(const TwoSidedProblem& problem, const TwoSidedMode& mode)
{
  const Complex lambda = mode.lambda;
  const auto on_both = [&](Mat A) { return A ? bilinear(mode.left, product(A, mode.right)) : 0; };
  const auto& [M, C, K] = problem.right;
  const Complex mass = on_both(M), damping = on_both(C);
  const Complex residual =
      lambda * lambda * mass + lambda * damping + on_both(K) + loss_factor_of(lambda) * on_both(problem.K_loss);
  return -residual / (2. * lambda * mass + damping);
}

} // namespace

Complex bilinear(const MultiVector& x, const MultiVector& y)
{
  const Eigen::MatrixXd products = inner_products(x, y);
  return {products(0, 0) - products(1, 1), products(0, 1) + products(1, 0)};
}

TwoSidedProblem make_two_sided(const QuadraticProblem& matrices, Mat K_loss, Mat K_z, Mat M_z,
                               const PencilOptions& options)
{
  return {matrices,
          K_loss,
          {transpose_of(matrices.M), transpose_of(matrices.C), transpose_of(matrices.K)},
          K_loss ? transpose_of(K_loss) : Owned<Mat>{},
          make_shift_invert(K_z, M_z, Keep::factor, options)};
}

TwoSidedMode find_two_sided(TwoSidedProblem& problem, Complex lambda, const MultiVector& start)
{
  move_to(problem.pencil, -(1 + beside) * (lambda * lambda).real());
  const PencilFactor& P = *problem.pencil.factor;
  const Eigenpair right = nearest_pair(problem.right, problem.K_loss, start, P, lambda),
                  left =
                      nearest_pair(problem.left, problem.K_loss_t, P.solve(product(problem.left.M, start)), P, lambda);
  TwoSidedMode mode{right.lambda, {}, {}, std::max(right.backward_error, left.backward_error)};
  if (!std::isfinite(mode.backward_error)) return mode;
  mode.right = parts_of(right);
  mode.left = parts_of(left);
  mode.lambda += change_of_lambda(problem, mode);
  if (lambda.imag() == 0) mode.lambda.imag(0);
  return mode;
}

} // namespace squeal
