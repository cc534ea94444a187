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

const auto oscillates = [](const auto& pair) { return pair.lambda.imag() > oscillating * std::abs(pair.lambda); };

/// Drops the pairs that real eigenvalues become under losses. Where there are more pairs than oscillate without losses,
/// they are the unmatched pairs nearest to a real one.
template <class Pair> void drop_real(std::vector<Pair>& pairs, const std::vector<Pair>& without)
{
  std::vector<Complex> vibrating, all;
  for (const Pair& pair : without)
    if (oscillates(pair)) vibrating.push_back(pair.lambda);
  if (vibrating.size() == without.size() || pairs.size() <= vibrating.size()) return;
  for (const Pair& pair : pairs) all.push_back(pair.lambda);
  const std::vector<std::size_t> theirs = nearest_places(vibrating, all);
  std::vector<Pair> kept;
  for (std::size_t k = 0; k < pairs.size(); ++k)
  {
    const auto distance = [&](const Pair& other) { return std::abs(other.lambda - pairs[k].lambda); };
    if (std::ranges::count(theirs, k) > 0 || oscillates(*std::ranges::min_element(without, {}, distance)))
      kept.push_back(std::move(pairs[k]));
  }
  pairs = std::move(kept);
}

/// The pairs that `solve` finds for M, C and K, real or complex; those that are real without losses stay as they are.
template <class Solve> auto with_losses(const LossyMatrices& problem, const Solve& solve)
{
  const auto& [M, C, K, K_loss] = problem;
  auto without = solve(M, C, K);
  if (K_loss.size() == 0) return without;
  auto pairs = solve(MatrixXcd(M.cast<Complex>()), MatrixXcd(C.cast<Complex>()), MatrixXcd(K + Complex(0, 1) * K_loss));
  drop_real(pairs, without);
  std::ranges::copy_if(without, std::back_inserter(pairs), std::not_fn(oscillates));
  return pairs;
}

} // namespace

std::vector<DenseEigenpair> solve_lossy_shared(MPI_Comm comm, const LossyMatrices& problem)
{
  return with_losses(problem, [&](const auto& M, const auto& C, const auto& K)
                     { return solve_dense_quadratic_shared(comm, M, C, K); });
}

std::vector<TwoSidedPair> solve_two_sided_lossy_shared(MPI_Comm comm, const LossyMatrices& problem, double limit)
{
  return with_losses(problem, [&](const auto& M, const auto& C, const auto& K)
                     { return solve_two_sided_shared(comm, M, C, K, limit); });
}

} // namespace squeal
