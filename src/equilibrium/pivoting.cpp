#include "pivoting.hpp"

#include <algorithm>
#include <Eigen/QR>
#include <numeric>
#include <ranges>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The solution of a set of closed pairs; nothing where a sign is wrong or the pairs do not balance. Where they share a
/// rigid face it is the shortest one.
std::optional<StickSlipState> solution_of(const StickSlipOperator& of, const VectorXd& q,
                                          const std::vector<char>& closed)
{
  constexpr double rounding = 1e-10; // of the largest unknown: what a grazing pair may lack
  MatrixXd system = of.N;
  for (Index i = 0; i < q.size(); ++i)
    if (closed[static_cast<std::size_t>(i)]) system.col(i) = -of.M.col(i) / of.compliance;
  const Eigen::PartialPivLU<MatrixXd> factors(system);
  const VectorXd pivots = factors.matrixLU().diagonal().cwiseAbs();
  VectorXd x;
  if (pivots.minCoeff() > 1e-11 * pivots.maxCoeff())
    x = factors.solve(q);
  else
  {
    Eigen::CompleteOrthogonalDecomposition<MatrixXd> orthogonal;
    orthogonal.setThreshold(1e-11);
    x = orthogonal.compute(system).solve(q);
  }
  if (!(x.minCoeff() >= -rounding * x.lpNorm<Eigen::Infinity>()) || !((system * x - q).norm() <= 1e-9 * q.norm()))
    return std::nullopt;
  StickSlipState state{VectorXd::Zero(q.size()), VectorXd::Zero(q.size())};
  for (Index i = 0; i < q.size(); ++i)
    closed[static_cast<std::size_t>(i)] ? state.r[i] = x[i] / of.compliance : state.w[i] = x[i];
  return state;
}

/// Gaps w and reactions, numbered from 0 on; z, the last number, is added to every gap:
///     x = table (y, z, 1),   x, y >= 0,   of each pair one variable on either side.
/// An exchange makes a variable of the right side one of the left.
struct Dictionary
{
  MatrixXd table;
  std::vector<Index> left, right;
};

/// The row whose variable is the first to fall to zero as a column's rises, z before others; -1: none falls.
Index leaving_row(const Dictionary& of, Index column)
{
  constexpr double rounding = 1e-11; // of entries, which are ratios of compliances
  Index best = -1;
  double least = 0;
  for (Index i = 0; i < of.table.rows(); ++i)
  {
    const double slope = of.table(i, column);
    if (slope >= -rounding) continue;
    const double until = of.table(i, of.table.cols() - 1) / -slope;
    const bool is_z = of.left[static_cast<std::size_t>(i)] == 2 * of.table.rows();
    if (best >= 0 && (is_z ? until > least + rounding * least : until >= least)) continue;
    best = i;
    least = until;
  }
  return best;
}

/// Solves the row for the column's variable and returns the one that went right.
Index exchange(Dictionary& of, Index row, Index column)
{
  const double pivot = of.table(row, column);
  of.table.row(row) /= -pivot;
  of.table(row, column) = 1 / pivot;
  const VectorXd entering = of.table.col(column);
  const Eigen::RowVectorXd solved = of.table.row(row);
  of.table += entering * solved;
  of.table.col(column) = entering / pivot;
  of.table.row(row) = solved;
  std::swap(of.left[static_cast<std::size_t>(row)], of.right[static_cast<std::size_t>(column)]);
  return of.right[static_cast<std::size_t>(column)];
}

/// The closed pairs at the end of Lemke's path, on which z falls and one pair at a time is neither open nor closed
/// (Cottle, Pang and Stone 1992, section 4.4).
std::optional<std::vector<char>> closed_by_path(const StickSlipOperator& of, const VectorXd& q)
{
  constexpr double softness = 1e-10; // of the compliance: pairs may share a rigid face
  const Index pairs = q.size(), z = 2 * pairs;
  MatrixXd sides(pairs, pairs + 1);
  sides << of.M / of.compliance, q;
  sides.diagonal().array() += softness;
  Dictionary dictionary{MatrixXd::Ones(pairs, pairs + 2), std::vector<Index>(static_cast<std::size_t>(pairs)), {}};
  sides = of.N.partialPivLu().solve(sides);
  dictionary.table.leftCols(pairs) = sides.leftCols(pairs);
  dictionary.table.rightCols(1) = sides.rightCols(1);
  if (!dictionary.table.allFinite()) return std::nullopt;
  std::iota(dictionary.left.begin(), dictionary.left.end(), 0);
  for (const Index gap : dictionary.left) dictionary.right.push_back(pairs + gap);
  dictionary.right.push_back(z);
  Index row = 0;
  if (dictionary.table.rightCols(1).col(0).minCoeff(&row) < 0)
  {
    Index out = exchange(dictionary, row, pairs);
    for (Index exchanges = 20 * pairs + 100; out != z; --exchanges)
    {
      const auto column = std::ranges::find(dictionary.right, (out + pairs) % z) - dictionary.right.begin();
      row = leaving_row(dictionary, column);
      if (row < 0 || exchanges == 0) return std::nullopt;
      out = exchange(dictionary, row, column);
    }
  }
  std::vector<char> closed(static_cast<std::size_t>(pairs), false);
  for (const Index variable : dictionary.right)
    if (variable < pairs) closed[static_cast<std::size_t>(variable)] = true;
  return closed;
}

} // namespace

std::optional<StickSlipState> rest_by_pivoting(const StickSlipOperator& of, const VectorXd& q)
{
  const auto pairs = static_cast<std::size_t>(q.size());
  if (const auto closed = closed_by_path(of, q))
    if (auto found = solution_of(of, q, *closed)) return found;
  for (std::size_t set = 0; q.size() <= few_pairs && set < (std::size_t{1} << pairs); ++set)
  {
    std::vector<char> closed(pairs);
    for (std::size_t i = 0; i < pairs; ++i) closed[i] = (set >> i) & 1;
    if (auto found = solution_of(of, q, closed)) return found;
  }
  return std::nullopt;
}

} // namespace squeal
