// ranks: 1
#include "../support/contact_problem.hpp"
#include "squeal/contact/complementarity.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <random>

using namespace squeal;
using test::difference;
using test::uniform;

namespace
{

/// D + mu E: a symmetric positive definite part and a friction part of any sign.
ComplementarityProblem random_problem(std::size_t n, double mu, std::mt19937& random)
{
  std::vector<double> H(n * n);
  for (double& value : H) value = uniform(random);
  ComplementarityProblem problem;
  problem.M.setZero(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  problem.q.resize(n);
  for (std::size_t i = 0; i < n; ++i)
  {
    problem.q[i] = uniform(random);
    for (std::size_t j = 0; j < n; ++j)
    {
      double& entry = problem.M(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
      for (std::size_t k = 0; k < n; ++k) entry += H[i * n + k] * H[j * n + k] / static_cast<double>(n);
      entry += (i == j ? 0.1 : 0.) + mu * uniform(random);
    }
  }
  problem.compliance = problem.M.diagonal().cwiseAbs().maxCoeff();
  return problem;
}

/// Every split, one after the other: those whose signs fit.
std::vector<std::vector<double>> all_solutions(const ComplementarityProblem& problem)
{
  const std::size_t n = problem.q.size();
  std::vector<std::vector<double>> found;
  for (std::size_t bits = 0; bits < (std::size_t{1} << n); ++bits)
  {
    std::vector<char> closed(n);
    for (std::size_t i = 0; i < n; ++i) closed[i] = (bits >> i) & 1;
    const auto split = SplitSolver(problem, closed).solve(problem.q);
    const double least = std::min(*std::min_element(split.gap.begin(), split.gap.end()),
                                  *std::min_element(split.reaction.begin(), split.reaction.end()));
    if (least >= 0 && split.defect < 1e-9) found.push_back(split.reaction);
  }
  return found;
}

} // namespace

TEST_CASE("the status iteration finds what trying every split finds")
{
  std::mt19937 random(5);
  for (int trial = 0; trial < 200; ++trial)
  {
    const auto problem = random_problem(1 + static_cast<std::size_t>(trial % 8), trial % 2 == 0 ? 0 : 0.02, random);
    const auto truth = all_solutions(problem);
    const auto found = solve_by_status(problem, std::vector<char>(problem.q.size(), trial % 3 == 0), 200);
    REQUIRE(truth.size() == 1); // little friction: one solution
    CHECK(found.outcome == StatusOutcome::converged);
    CHECK(difference(found.reaction, truth[0]) < 1e-9); // condition below 1e5
    const auto pivoted = solve_by_status(problem, std::vector<char>(problem.q.size(), trial % 3 == 0), 0);
    CHECK(pivoted.outcome == StatusOutcome::converged);
    CHECK(difference(pivoted.reaction, truth[0]) < 1e-9);
  }
}

TEST_CASE("much friction: what is found is one of the solutions, and where there is none that is proved")
{
  std::mt19937 random(9);
  int none = 0, several = 0;
  for (int trial = 0; trial < 300; ++trial)
  {
    const auto problem = random_problem(5, 2, random);
    const auto truth = all_solutions(problem);
    const auto found = solve_by_status(problem, std::vector<char>(5, 1), 200);
    CHECK((found.outcome == StatusOutcome::converged) == !truth.empty());
    if (truth.empty())
      CHECK(found.outcome == StatusOutcome::impossible);
    else
    {
      double nearest = HUGE_VAL;
      for (const auto& solution : truth) nearest = std::min(nearest, difference(found.reaction, solution));
      CHECK(nearest < 1e-6);
    }
    none += truth.empty() ? 1 : 0;
    several += truth.size() > 1 ? 1 : 0;
  }
  CHECK(std::min(none, several) > 10); // both were met
}

TEST_CASE("many pairs: a path finds the solution, and friction that pulls every pair open is proved to have none")
{
  std::mt19937 random(3);
  for (int trial = 0; trial < 20; ++trial)
  {
    auto problem = random_problem(60, 0.005, random);
    const auto found = solve_by_status(problem, std::vector<char>(60, 0), 200);
    const auto pivoted = solve_by_status(problem, std::vector<char>(60, trial % 2 == 0), 0);
    REQUIRE(found.outcome == StatusOutcome::converged);
    CHECK(pivoted.outcome == StatusOutcome::converged);
    CHECK(difference(pivoted.reaction, found.reaction) < 1e-7);
    problem.M = -problem.M.cwiseAbs(); // every reaction closes every gap
    CHECK(solve_by_status(problem, std::vector<char>(60, 0), 100).outcome == StatusOutcome::impossible);
  }
}

TEST_CASE("without pairs there is one solution")
{
  CHECK(has_one_solution(ComplementarityProblem{}));
}

TEST_CASE("a gap at rounding counts as closed, whatever the unit of force")
{
  for (const double factor : {1., 1e-6, 1e6})
  {
    ComplementarityProblem problem;
    problem.M = Eigen::Matrix2d{{2 / factor, 1 / factor}, {1 / factor, 2 / factor}};
    problem.q = {-3, -1.5 + 1e-16}; // the second pair just touches under the first one's reaction
    problem.compliance = 2 / factor;
    const auto found = solve_by_status(problem, {1, 1}, 10);
    CHECK(found.outcome == StatusOutcome::converged);
    CHECK(found.iterations == 1);
    CHECK(std::abs(found.reaction[0] / factor - 1.5) < 1e-15);
    CHECK(std::abs(found.reaction[1] / factor) < 1e-15);
  }
}

TEST_CASE("pairs that share a rigid face share its load evenly")
{
  ComplementarityProblem problem;
  problem.M.setOnes(3, 3);
  problem.q = {-6, -6, -6};
  problem.compliance = 1;
  const auto found = solve_by_status(problem, {1, 1, 1}, 10);
  CHECK(found.outcome == StatusOutcome::converged);
  for (const double r : found.reaction) CHECK(std::abs(r - 2) < 1e-13);
}
