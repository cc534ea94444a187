#include "squeal/modes/dense_losses.hpp"

#include <algorithm>
#include <iterator>

namespace squeal
{

using Complex = std::complex<double>;
using Eigen::MatrixXcd;

Complex loss_factor_of(Complex lambda)
{
  return {0, lambda.imag() > 0 ? 1. : 0.};
}

ComplexFactors loss_factors(Complex lambda)
{
  return {lambda * lambda, lambda, 1, loss_factor_of(lambda)};
}

MatrixXcd sum(const LossyMatrices& A, const ComplexFactors& factors)
{
  MatrixXcd result = factors[0] * A[0];
  for (std::size_t k = 1; k < A.size(); ++k)
    if (A[k].size() > 0) result += factors[k] * A[k];
  return result;
}

namespace
{

constexpr double oscillating = 1e-6; // Im(lambda) over |lambda|: below it is the rounding of two real ones

bool oscillates(const TwoSidedPair& pair)
{
  return pair.lambda.imag() > oscillating * std::abs(pair.lambda);
}

bool has_losses(const LossyMatrices& problem)
{
  return problem[3].size() > 0;
}

/// M, C and K + i K_loss.
std::array<MatrixXcd, 3> with_complex_stiffness(const LossyMatrices& problem)
{
  const auto& [M, C, K, K_loss] = problem;
  return {M.cast<Complex>(), C.cast<Complex>(), K + Complex(0, 1) * K_loss};
}

std::vector<Complex> lambdas_of(const std::vector<TwoSidedPair>& pairs)
{
  std::vector<Complex> values;
  std::ranges::transform(pairs, std::back_inserter(values), &TwoSidedPair::lambda);
  return values;
}

/// Drops the pairs that real eigenvalues become under losses. Where there are more pairs than oscillate without losses,
/// they are the unmatched pairs nearest to a real one.
void drop_real(std::vector<TwoSidedPair>& pairs, const std::vector<TwoSidedPair>& without)
{
  std::vector<Complex> vibrating;
  for (const TwoSidedPair& pair : without)
    if (oscillates(pair)) vibrating.push_back(pair.lambda);
  if (vibrating.size() == without.size() || pairs.size() <= vibrating.size()) return;
  const std::vector<std::size_t> theirs = nearest_places(vibrating, lambdas_of(pairs));
  std::vector<TwoSidedPair> kept;
  for (std::size_t k = 0; k < pairs.size(); ++k)
  {
    const auto distance = [&](const TwoSidedPair& other) { return std::abs(other.lambda - pairs[k].lambda); };
    if (std::ranges::count(theirs, k) > 0 || oscillates(*std::ranges::min_element(without, {}, distance)))
      kept.push_back(std::move(pairs[k]));
  }
  pairs = std::move(kept);
}

} // namespace

std::vector<DenseEigenpair> solve_lossy_shared(MPI_Comm comm, const LossyMatrices& problem)
{
  const auto& [M, C, K, K_loss] = problem;
  if (!has_losses(problem)) return solve_dense_quadratic_shared(comm, M, C, K);
  const auto [m, c, k] = with_complex_stiffness(problem);
  return solve_dense_quadratic_shared(comm, m, c, k);
}

std::vector<TwoSidedPair> solve_two_sided_lossy_shared(MPI_Comm comm, const LossyMatrices& problem, double limit)
{
  const auto& [M, C, K, K_loss] = problem;
  std::vector<TwoSidedPair> without = solve_two_sided_shared(comm, M, C, K, limit);
  if (!has_losses(problem)) return without;
  const auto [m, c, k] = with_complex_stiffness(problem);
  std::vector<TwoSidedPair> pairs = solve_two_sided_shared(comm, m, c, k, limit);
  drop_real(pairs, without);
  std::ranges::copy_if(without, std::back_inserter(pairs), std::not_fn(oscillates));
  return pairs;
}

} // namespace squeal
