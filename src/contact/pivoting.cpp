#include "squeal/base/error.hpp"
#include "squeal/contact/complementarity.hpp"

#include <algorithm>
#include <Eigen/Dense>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The problem seen from a split: x are the gaps and scaled reactions that it leaves open, y those that it sets to
/// zero, and z is added to all of x:
///     x = b + P y + z,   x, y >= 0,   x_i y_i = 0.
/// An exchange makes a variable of the right side one of the left. Variables are numbered x, y, z.
class Dictionary
{
public:
  /// A little compliance on every pair makes P finite where pairs share a rigid face.
  Dictionary(const ComplementarityProblem& problem, const std::vector<char>& closed)
      : pairs_(static_cast<Index>(closed.size())), closed_(closed)
  {
    constexpr double softness = 1e-10; // of the compliance
    MatrixXd gaps = problem.N.size() == 0 ? MatrixXd::Identity(pairs_, pairs_) : problem.N;
    MatrixXd reactions = problem.M / -problem.compliance;
    reactions.diagonal().array() -= softness;
    for (Index i = 0; i < pairs_; ++i)
      if (is_closed(i)) gaps.col(i).swap(reactions.col(i));
    const Eigen::PartialPivLU<MatrixXd> unknown(gaps);
    table_.resize(pairs_, pairs_ + 2);
    table_.leftCols(pairs_) = -unknown.solve(reactions);
    table_.col(pairs_).setOnes();
    table_.col(pairs_ + 1) = unknown.solve(VectorXd::Map(problem.q.data(), pairs_));
    for (Index i = 0; i < pairs_; ++i)
    {
      left_.push_back(i);
      right_.push_back(pairs_ + i);
    }
    right_.push_back(z());
  }

  bool is_finite() const { return table_.allFinite(); }

  /// Lemke's method (Cottle, Pang and Stone 1992, section 4.4): z falls along a path on which one pair at a time is
  /// neither open nor closed. Whether it came to zero.
  bool follow_path()
  {
    Index row = 0;
    if (constants().minCoeff(&row) >= 0) return true;
    Index entering = exchange(row, pairs_);
    for (Index left = most_exchanges(); entering != z() && left > 0; --left)
    {
      const auto column = std::ranges::find(right_, (entering + pairs_) % (2 * pairs_)) - right_.begin();
      row = leaving_row(column);
      if (row < 0) return false;
      entering = exchange(row, column);
    }
    return entering == z();
  }

  /// Whether x, y >= 0 keep z above zero even where x_i y_i need not be zero: then there is no solution. From the end
  /// of a path.
  bool is_impossible()
  {
    constexpr double surely = 1e-7; // of the largest constant
    for (Index left = most_exchanges(); left > 0; --left)
    {
      const Index of_z = std::ranges::find(left_, z()) - left_.begin();
      if (of_z == pairs_) return false;
      Index column = 0;
      if (table_.row(of_z).head(pairs_ + 1).minCoeff(&column) >= -rounding)
        return constants()[of_z] > surely * constants().cwiseAbs().maxCoeff();
      const Index row = leaving_row(column);
      if (row < 0) return false;
      exchange(row, column);
    }
    return false;
  }

  std::vector<char> split() const
  {
    std::vector<char> closed = closed_;
    for (const Index variable : right_)
      if (variable < pairs_) closed[static_cast<std::size_t>(variable)] = !closed[static_cast<std::size_t>(variable)];
    return closed;
  }

private:
  static constexpr double rounding = 1e-11; // of entries, which are ratios of compliances

  Index z() const { return 2 * pairs_; }
  Index most_exchanges() const { return 20 * pairs_ + 100; }
  bool is_closed(Index pair) const { return closed_[static_cast<std::size_t>(pair)]; }
  MatrixXd::ColXpr constants() { return table_.col(pairs_ + 1); }

  /// The row whose variable is the first to fall to zero as a column's rises, z before others; -1: none falls.
  Index leaving_row(Index column)
  {
    Index best = -1;
    double least = 0;
    for (Index i = 0; i < pairs_; ++i)
    {
      const double slope = table_(i, column);
      if (slope >= -rounding) continue;
      const double until = constants()[i] / -slope;
      const bool is_z = left_[static_cast<std::size_t>(i)] == z();
      if (best >= 0 && (is_z ? until > least + rounding * least : until >= least)) continue;
      best = i;
      least = until;
    }
    return best;
  }

  /// Solves the row for the column's variable and returns the one that went right.
  Index exchange(Index row, Index column)
  {
    const double pivot = table_(row, column);
    table_.row(row) /= -pivot;
    table_(row, column) = 1 / pivot;
    const VectorXd entering = table_.col(column);
    const Eigen::RowVectorXd solved = table_.row(row);
    for (Index j = 0; j < table_.cols(); ++j)
      if (j != column) table_.col(j) += solved[j] * entering;
    table_.col(column) = entering / pivot;
    table_.row(row) = solved;
    std::swap(left_[static_cast<std::size_t>(row)], right_[static_cast<std::size_t>(column)]);
    return right_[static_cast<std::size_t>(column)];
  }

  Index pairs_;
  std::vector<char> closed_; // of the split
  MatrixXd table_;           // P, the ones of z, b
  std::vector<Index> left_, right_;
};

/// Tries every split. One that fits is the answer, and where none does there is no solution.
StatusSolution try_all(const ComplementarityProblem& problem)
{
  const std::size_t pairs = problem.q.size();
  StatusSolution result;
  std::vector<char> closed(pairs);
  for (std::size_t set = 0; set < (std::size_t{1} << pairs); ++set)
  {
    for (std::size_t i = 0; i < pairs; ++i) closed[i] = (set >> i) & 1;
    result = solve_by_status(problem, closed, 1);
    if (result.outcome == StatusOutcome::converged) return result;
  }
  result.outcome = StatusOutcome::impossible;
  return result;
}

} // namespace

StatusSolution solve_by_pivoting(const ComplementarityProblem& problem, const std::vector<char>& closed)
{
  constexpr std::size_t few = 12; // pairs: 4096 splits, which take less than the path of a thousand pairs
  Dictionary dictionary(problem, closed);
  const bool finite = dictionary.is_finite();
  if (finite && dictionary.follow_path())
    if (StatusSolution found = solve_by_status(problem, dictionary.split(), 1);
        found.outcome == StatusOutcome::converged)
      return found;
  if (closed.size() <= few) return try_all(problem);
  StatusSolution none;
  none.outcome = finite && dictionary.is_impossible() ? StatusOutcome::impossible : StatusOutcome::not_converged;
  none.closed = closed;
  return none;
}

} // namespace squeal
