#pragma once
/// A chain of cells of two modes each that friction couples (M = I, C = 0.02 I): 100 pairs of 50 cells lie within 1 %
/// to 30 % of each other, many close to coalescence.
#include "small_models.hpp"
#include "squeal/modes/modes.hpp"
#include "squeal/modes/quadratic.hpp"

#include <cmath>

namespace squeal::test
{

inline QuadraticProblem problem_of(const Rows& M, const Rows& C, const Rows& K)
{
  Rows pattern = diagonal(std::vector<double>(M.size(), 1.));
  for (std::size_t i = 0; i < M.size(); ++i)
    for (std::size_t j = 0; j < M.size(); ++j)
      if (M[i][j] != 0 || C[i][j] != 0 || K[i][j] != 0) pattern[i][j] = 1;
  return {sparse(M, pattern), sparse(C, pattern), sparse(K, pattern)};
}

inline QuadraticProblem flutter_chain(int cells, double mu)
{
  const double k = 4.5 * std::sqrt(3.) / 2;
  const auto n = 2 * static_cast<std::size_t>(cells);
  Rows K = zeros(n, n);
  for (std::size_t i = 0; i < n; i += 2)
  {
    K[i][i] = 2 + 17;
    K[i][i + 1] = k - 11 * mu;
    K[i + 1][i] = k;
    K[i + 1][i + 1] = 18.75;
    if (i + 2 < n) K[i][i + 2] = K[i + 2][i] = -1;
  }
  return problem_of(diagonal(std::vector<double>(n, 1.)), diagonal(std::vector<double>(n, 0.02)), K);
}

inline int count_unstable(const QuadraticSolution& solution)
{
  int count = 0;
  for (const Eigenpair& pair : solution.pairs) count += is_unstable(pair.lambda);
  return count;
}

} // namespace squeal::test
