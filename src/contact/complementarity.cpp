#include "squeal/contact/complementarity.hpp"

#include "squeal/base/petsc.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#include <set>

namespace squeal
{

namespace
{

constexpr double sign_tolerance = 1e-10; // of the largest unknown: what rounding leaves of a grazing pair
constexpr double defect_tolerance = 1e-9;

using Dense = std::vector<double>; // column-major

Dense split_matrix(const ComplementarityProblem& problem, const std::vector<char>& closed)
{
  const std::size_t n = problem.q.size();
  Dense matrix(n * n, 0.);
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = 0; i < n; ++i)
    {
      const double open_entry = problem.N.empty() ? (i == j ? 1. : 0.) : problem.N[i * n + j];
      matrix[j * n + i] = closed[j] ? -problem.M[i * n + j] / problem.compliance : open_entry;
    }
  return matrix;
}

double relative_defect(const Dense& matrix, const Dense& x, const std::vector<double>& rhs)
{
  const std::size_t n = rhs.size();
  Dense residual = rhs;
  double scale = 0, defect = 0;
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = 0; i < n; ++i) residual[i] -= matrix[j * n + i] * x[j];
  for (std::size_t i = 0; i < n; ++i)
  {
    scale = std::max({scale, std::abs(rhs[i]), std::abs(x[i])});
    defect = std::max(defect, std::abs(residual[i]));
  }
  return scale > 0 ? defect / scale : 0;
}

Eigen::Map<const Eigen::MatrixXd> square(const Dense& matrix, std::size_t n)
{
  return Eigen::MatrixXd::Map(matrix.data(), static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
}

/// False if a pivot is lost in rounding.
bool solve_by_lu(const Dense& matrix, std::vector<double>& x)
{
  const Eigen::PartialPivLU<Eigen::MatrixXd> factor(square(matrix, x.size()));
  const Eigen::ArrayXd pivots = factor.matrixLU().diagonal().cwiseAbs();
  if (!(pivots.minCoeff() > 1e-13 * pivots.maxCoeff())) return false;
  auto unknowns = Eigen::VectorXd::Map(x.data(), pivots.size());
  unknowns = factor.solve(unknowns).eval();
  return true;
}

/// The shortest of the least-squares solutions: pairs that share a rigid face share its load evenly.
void solve_by_svd(const Dense& matrix, std::vector<double>& x)
{
  Eigen::JacobiSVD<Eigen::MatrixXd> values(square(matrix, x.size()), Eigen::ComputeThinU | Eigen::ComputeThinV);
  values.setThreshold(1e-12);
  auto unknowns = Eigen::VectorXd::Map(x.data(), static_cast<Eigen::Index>(x.size()));
  unknowns = values.solve(unknowns).eval();
}

std::vector<double> gaps(const ComplementarityProblem& problem, const std::vector<double>& r)
{
  const auto n = static_cast<Eigen::Index>(problem.q.size());
  std::vector<double> g = problem.q;
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<Eigen::VectorXd>(g.data(), n).noalias() +=
      Eigen::Map<const RowMajor>(problem.M.data(), n, n) * Eigen::Map<const Eigen::VectorXd>(r.data(), n);
  return g;
}

} // namespace

SplitSolution solve_split(const ComplementarityProblem& problem, const std::vector<char>& closed,
                          const std::vector<double>& rhs)
{
  const std::size_t n = problem.q.size();
  SplitSolution solution;
  solution.gap.assign(n, 0.);
  solution.reaction.assign(n, 0.);
  if (n == 0) return solution;
  const Dense matrix = split_matrix(problem, closed);
  std::vector<double> x = rhs;
  // the singular values of a matrix with an entry that is not a number do not converge
  const auto finite = [](double value) { return std::isfinite(value); };
  if (!std::all_of(matrix.begin(), matrix.end(), finite) || !std::all_of(x.begin(), x.end(), finite))
    throw Error("contact at rest: the compliance of the pairs is not a finite number");
  if (!solve_by_lu(matrix, x))
  {
    x = rhs;
    solve_by_svd(matrix, x);
  }
  solution.defect = relative_defect(matrix, x, rhs);
  for (std::size_t i = 0; i < n; ++i)
    if (closed[i])
      solution.reaction[i] = x[i] / problem.compliance;
    else
      solution.gap[i] = x[i];
  return solution;
}

StatusSolution solve_by_status(const ComplementarityProblem& problem, std::vector<char> closed, int max_iterations)
{
  const std::size_t n = problem.q.size();
  constexpr int patience = 10;
  StatusSolution result;
  std::size_t fewest = n + 1;
  int tries = patience;
  std::set<std::vector<char>> met; // while pairs change one at a time
  for (result.iterations = 1; result.iterations <= max_iterations; ++result.iterations)
  {
    const SplitSolution split = solve_split(problem, closed, problem.q);
    double scale = 0;
    for (std::size_t i = 0; i < n; ++i)
      scale = std::max({scale, std::abs(split.gap[i]), problem.compliance * std::abs(split.reaction[i])});
    std::vector<std::size_t> wrong;
    for (std::size_t i = 0; i < n; ++i)
      if (std::min(split.gap[i], problem.compliance * split.reaction[i]) < -sign_tolerance * scale) wrong.push_back(i);
    if (wrong.empty())
    {
      result.outcome = split.defect <= defect_tolerance ? "converged" : "singular";
      result.gap = split.gap;
      result.reaction = split.reaction;
      for (double& value : result.gap) value = std::max(0., value);
      for (double& value : result.reaction) value = std::max(0., value);
      result.closed = std::move(closed);
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
  result.outcome = result.iterations <= max_iterations ? "cycles" : "not converged";
  result.closed = std::move(closed);
  return result;
}

bool has_one_solution(const ComplementarityProblem& problem)
{
  const std::size_t n = problem.q.size();
  Dense symmetric(n * n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) symmetric[j * n + i] = (problem.M[i * n + j] + problem.M[j * n + i]) / 2;
  return n == 0 || Eigen::LLT<Eigen::MatrixXd>(square(symmetric, n)).info() == Eigen::Success;
}

ProjectionSolution solve_by_projection(const ComplementarityProblem& problem, double rho, double tolerance,
                                       int max_iterations)
{
  const std::size_t n = problem.q.size();
  ProjectionSolution result;
  result.reaction.assign(n, 0.);
  double best = HUGE_VAL;
  for (;; ++result.iterations)
  {
    const auto g = gaps(problem, result.reaction);
    double error = 0, scale = 0, pull = 0;
    for (std::size_t i = 0; i < n; ++i)
    {
      const double r = result.reaction[i], shift = g[i] / problem.compliance;
      error = std::max(error, std::abs(r - std::max(0., r - shift)));
      scale = std::max(scale, r);
      pull = std::max(pull, std::abs(problem.q[i]) / problem.compliance);
    }
    result.residual = error == 0 ? 0 : error / (scale > 0 ? scale : pull);
    best = std::min(best, result.residual);
    if (result.residual <= tolerance || !std::isfinite(result.residual) || result.iterations >= max_iterations)
      return result;
    if (result.iterations % 50 == 49 && result.residual > 10 * best) rho /= 2;
    for (std::size_t i = 0; i < n; ++i) result.reaction[i] = std::max(0., result.reaction[i] - rho * g[i]);
  }
}

double largest_eigenvalue(const std::vector<double>& matrix, std::size_t n, int iterations)
{
  const auto size = static_cast<Eigen::Index>(n);
  const Eigen::Map<const Eigen::MatrixXd> A(matrix.data(), size, size);
  Eigen::VectorXd x(size), image(size);
  for (Eigen::Index i = 0; i < size; ++i) x[i] = 1 + .5 * std::sin(7. * static_cast<double>(i) + 1);
  double eigenvalue = 0;
  for (int iteration = 0; iteration < iterations; ++iteration)
  {
    if (x.norm() == 0) return 0;
    x.normalize();
    image.noalias() = A.selfadjointView<Eigen::Lower>() * x;
    eigenvalue = image.norm();
    x.swap(image);
  }
  return eigenvalue;
}

} // namespace squeal
