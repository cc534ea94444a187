#include "squeal/contact/complementarity.hpp"

#include "squeal/base/error.hpp"
#include "squeal/contact/pair_law.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double sign_tolerance = 1e-10; // of the largest unknown: what rounding leaves of a grazing pair
constexpr double defect_tolerance = 1e-9;

Eigen::Map<const VectorXd> as_vector(const std::vector<double>& values)
{
  return {values.data(), static_cast<Index>(values.size())};
}

/// Columns of -M/compliance where closed, of N elsewhere.
MatrixXd split_matrix(const ComplementarityProblem& problem, const std::vector<char>& closed)
{
  const auto n = static_cast<Index>(problem.q.size());
  MatrixXd matrix = problem.N.size() == 0 ? MatrixXd::Identity(n, n) : problem.N;
  for (Index j = 0; j < n; ++j)
    if (closed[static_cast<std::size_t>(j)]) matrix.col(j) = -problem.M.col(j) / problem.compliance;
  return matrix;
}

/// |rhs - N g + M r| over the largest of rhs, the gaps and the reactions times their compliance.
double relative_defect(const ComplementarityProblem& problem, const SplitSolution& solution, const VectorXd& rhs)
{
  const auto g = as_vector(solution.gap), r = as_vector(solution.reaction);
  const double scale = std::max(
      {rhs.lpNorm<Eigen::Infinity>(), g.lpNorm<Eigen::Infinity>(), problem.compliance * r.lpNorm<Eigen::Infinity>()});
  if (!(scale > 0)) return 0;
  VectorXd defect = rhs + problem.M * r;
  if (problem.N.size() == 0)
    defect -= g;
  else
    defect.noalias() -= problem.N * g;
  return defect.lpNorm<Eigen::Infinity>() / scale;
}

/// The shortest of the least-squares solutions: pairs that share a rigid face share its load evenly.
VectorXd shortest_solution(const MatrixXd& matrix, const VectorXd& rhs)
{
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> orthogonal;
  orthogonal.setThreshold(1e-12);
  orthogonal.compute(matrix);
  return orthogonal.solve(rhs);
}

} // namespace

SplitSolver::SplitSolver(const ComplementarityProblem& problem, std::vector<char> closed)
    : problem_(problem), closed_(std::move(closed)), storage_(split_matrix(problem, closed_))
{
  if (closed_.empty()) return;
  if (!storage_.allFinite()) throw Error("contact at rest: the compliance of the pairs is not a finite number");
  factors_.emplace(storage_); // in place
  const VectorXd pivots = factors_->matrixLU().diagonal().cwiseAbs();
  if (!(pivots.minCoeff() > 1e-13 * pivots.maxCoeff())) factors_.reset();
}

SplitSolution SplitSolver::solve(const std::vector<double>& rhs) const
{
  const std::size_t n = closed_.size();
  SplitSolution solution;
  solution.gap.assign(n, 0.);
  solution.reaction.assign(n, 0.);
  if (n == 0) return solution;
  if (!as_vector(rhs).allFinite())
    throw Error(
        "contact at rest: the gaps under the loads are not finite numbers: are forces in N and pressures in Pa?");
  const VectorXd x = factors_ ? VectorXd(factors_->solve(as_vector(rhs)))
                              : shortest_solution(split_matrix(problem_, closed_), as_vector(rhs));
  for (std::size_t i = 0; i < n; ++i)
    if (closed_[i])
      solution.reaction[i] = x[static_cast<Index>(i)] / problem_.compliance;
    else
      solution.gap[i] = x[static_cast<Index>(i)];
  solution.defect = relative_defect(problem_, solution, as_vector(rhs));
  return solution;
}

namespace
{

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

/// The solution of a split; nothing where a sign is wrong or the split does not balance. `wrong`: pairs with a negative
/// gap or reaction, rounding aside.
std::optional<StatusSolution> solution_of(const ComplementarityProblem& problem, const std::vector<char>& closed,
                                          std::vector<std::size_t>& wrong)
{
  auto solver = std::make_unique<SplitSolver>(problem, closed);
  SplitSolution split = solver->solve(problem.q);
  double scale = 0;
  for (std::size_t i = 0; i < closed.size(); ++i)
    scale = std::max({scale, std::abs(split.gap[i]), problem.compliance * std::abs(split.reaction[i])});
  wrong.clear();
  for (std::size_t i = 0; i < closed.size(); ++i)
    if (std::min(split.gap[i], problem.compliance * split.reaction[i]) < -sign_tolerance * scale) wrong.push_back(i);
  if (!wrong.empty() || split.defect > defect_tolerance) return std::nullopt;
  for (double& value : split.gap) value = std::max(0., value);
  for (double& value : split.reaction) value = std::max(0., value);
  return StatusSolution{StatusOutcome::converged, 1, closed, std::move(split.gap), std::move(split.reaction),
                        std::move(solver)};
}

/// The solution by Lemke's path from a split, or by trying every split of few pairs.
StatusSolution solve_by_pivoting(const ComplementarityProblem& problem, std::vector<char> closed)
{
  constexpr std::size_t few = 12; // pairs: 4096 splits, which take less than the path of a thousand pairs
  const std::size_t pairs = closed.size();
  std::vector<std::size_t> wrong;
  Dictionary dictionary(problem, closed);
  const bool finite = dictionary.is_finite();
  if (finite && dictionary.follow_path())
    if (auto found = solution_of(problem, dictionary.split(), wrong)) return std::move(*found);
  for (std::size_t set = 0; pairs <= few && set < (std::size_t{1} << pairs); ++set)
  {
    for (std::size_t i = 0; i < pairs; ++i) closed[i] = (set >> i) & 1;
    if (auto found = solution_of(problem, closed, wrong)) return std::move(*found);
  }
  StatusSolution none;
  if (pairs <= few || (finite && dictionary.is_impossible())) none.outcome = StatusOutcome::impossible;
  none.closed = std::move(closed);
  return none;
}

} // namespace

StatusSolution solve_by_status(const ComplementarityProblem& problem, const std::vector<char>& first,
                               int max_iterations)
{
  std::vector<char> closed = first;
  std::size_t fewest = problem.q.size() + 1;
  constexpr int patience = 10;
  int iterations = 1;
  for (int tries = patience; iterations <= max_iterations && tries >= 0; ++iterations)
  {
    std::vector<std::size_t> wrong;
    if (auto found = solution_of(problem, closed, wrong))
    {
      found->iterations = iterations;
      return std::move(*found);
    }
    if (wrong.empty()) break; // it does not balance
    tries = wrong.size() < fewest ? patience : tries - 1;
    fewest = std::min(fewest, wrong.size());
    for (const std::size_t i : wrong) closed[i] = !closed[i];
  }
  StatusSolution result = solve_by_pivoting(problem, first);
  result.iterations += iterations;
  return result;
}

bool has_one_solution(const ComplementarityProblem& problem)
{
  if (problem.M.rows() == 0) return true;
  MatrixXd symmetric = (problem.M + problem.M.transpose()) / 2;
  return Eigen::LLT<Eigen::Ref<MatrixXd>>(symmetric).info() == Eigen::Success; // in place
}

double unilateral_residual(const std::vector<double>& reaction, const std::vector<double>& gap,
                           const std::vector<double>& rho, const std::vector<double>& pull)
{
  double error = 0, scale = 0, otherwise = 0;
  for (std::size_t i = 0; i < gap.size(); ++i)
  {
    error = std::max(error, normal_map(reaction[i], gap[i], rho[i]));
    scale = std::max(scale, reaction[i]);
    otherwise = std::max(otherwise, rho[i] * std::abs(pull[i]));
  }
  return error == 0 ? 0 : error / (scale > 0 ? scale : otherwise);
}

} // namespace squeal
