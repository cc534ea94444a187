#include "squeal/contact/complementarity.hpp"

#include "squeal/base/error.hpp"
#include "squeal/contact/pair_law.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#include <set>

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

SplitSolution solve_split(const ComplementarityProblem& problem, const std::vector<char>& closed,
                          const std::vector<double>& rhs)
{
  return SplitSolver(problem, closed).solve(rhs);
}

namespace
{

/// Pairs with a negative gap or reaction, rounding aside.
std::vector<std::size_t> wrong_pairs(const SplitSolution& split, double compliance)
{
  double scale = 0;
  for (std::size_t i = 0; i < split.gap.size(); ++i)
    scale = std::max({scale, std::abs(split.gap[i]), compliance * std::abs(split.reaction[i])});
  std::vector<std::size_t> wrong;
  for (std::size_t i = 0; i < split.gap.size(); ++i)
    if (std::min(split.gap[i], compliance * split.reaction[i]) < -sign_tolerance * scale) wrong.push_back(i);
  return wrong;
}

} // namespace

StatusSolution solve_by_status(const ComplementarityProblem& problem, std::vector<char> closed, long max_iterations)
{
  constexpr int patience = 10;
  StatusSolution result;
  std::size_t fewest = problem.q.size() + 1;
  int tries = patience;
  std::set<std::vector<char>> met; // while pairs change one at a time
  for (result.iterations = 1; result.iterations <= max_iterations; ++result.iterations)
  {
    auto solver = std::make_unique<SplitSolver>(problem, closed);
    SplitSolution split = solver->solve(problem.q);
    std::vector<std::size_t> wrong = wrong_pairs(split, problem.compliance);
    if (wrong.empty())
    {
      result.outcome = split.defect <= defect_tolerance ? StatusOutcome::converged : StatusOutcome::singular;
      result.gap = std::move(split.gap);
      result.reaction = std::move(split.reaction);
      for (double& value : result.gap) value = std::max(0., value);
      for (double& value : result.reaction) value = std::max(0., value);
      result.closed = std::move(closed);
      result.solver = std::move(solver);
      return result;
    }
    tries = wrong.size() < fewest ? patience : tries - 1;
    fewest = std::min(fewest, wrong.size());
    if (tries == patience) met.clear();
    if (tries < 0)
    {
      if (!met.insert(closed).second) break;
      wrong = {wrong.back()};
    }
    for (const std::size_t i : wrong) closed[i] = !closed[i];
  }
  result.closed = std::move(closed);
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
