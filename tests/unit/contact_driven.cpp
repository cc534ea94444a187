// ranks: 1
// The rest of driven pairs, whose friction is part of the compliance, against every set of closed pairs.
#include "../support/contact_problem.hpp"
#include "squeal/equilibrium/path_walk.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <Eigen/Dense>
#include <random>

using namespace squeal;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::uniform;

namespace
{

struct Rest
{
  MatrixXd M;
  VectorXd q;

  StickSlipOperator of() const
  {
    return make_stick_slip_operator(MatrixXd::Identity(q.size(), q.size()), M, M.diagonal().cwiseAbs(), 0,
                                    std::vector<int>(static_cast<std::size_t>(q.size()), 0));
  }

  PathWalk find(const std::vector<char>& expected) const
  {
    const StickSlipOperator op = of();
    const auto pairs = static_cast<std::size_t>(q.size());
    return rest_of({op, 0, std::vector<double>(pairs, 0.), {std::vector<double>(pairs, 0.), {}}, {{"load", q, 1}}},
                   expected);
  }
};

/// D + mu E: a symmetric positive definite part and a friction part of any sign.
Rest random_problem(Index n, double mu, std::mt19937& random)
{
  const auto draw = [&] { return uniform(random); };
  const MatrixXd H = MatrixXd::NullaryExpr(n, n, draw);
  const MatrixXd D = H * H.transpose() / static_cast<double>(n) + 0.1 * MatrixXd::Identity(n, n);
  return {D + mu * MatrixXd::NullaryExpr(n, n, draw), VectorXd::NullaryExpr(n, draw)};
}

/// Reactions of every set of closed pairs whose signs fit, one after the other.
std::vector<VectorXd> all_solutions(const Rest& problem)
{
  const Index n = problem.q.size();
  std::vector<VectorXd> found;
  for (Index bits = 0; bits < (Index{1} << n); ++bits)
  {
    MatrixXd system = MatrixXd::Identity(n, n);
    for (Index i = 0; i < n; ++i)
      if ((bits >> i) & 1) system.col(i) = -problem.M.col(i);
    VectorXd x = system.fullPivLu().solve(problem.q);
    if (x.minCoeff() < 0) continue;
    for (Index i = 0; i < n; ++i)
      if (!((bits >> i) & 1)) x[i] = 0;
    found.push_back(x);
  }
  return found;
}

double distance(const VectorXd& a, const VectorXd& b)
{
  return (a - b).lpNorm<Eigen::Infinity>();
}

} // namespace

TEST_CASE("the rest of driven pairs is what trying every set of closed pairs finds")
{
  std::mt19937 random(5);
  for (int trial = 0; trial < 200; ++trial)
  {
    const Rest problem = random_problem(1 + trial % 8, trial % 2 == 0 ? 0 : 0.02, random);
    const auto truth = all_solutions(problem);
    REQUIRE(truth.size() == 1); // little friction: one solution
    const PathWalk found = problem.find(std::vector<char>(static_cast<std::size_t>(problem.q.size()), trial % 3 == 0));
    CHECK(found.completed);
    CHECK(distance(found.state.r, truth[0]) < 1e-9); // condition below 1e5
  }
}

TEST_CASE("much friction: what is found is one of the solutions, and none is proved away")
{
  std::mt19937 random(9);
  int none = 0, several = 0;
  for (int trial = 0; trial < 300; ++trial)
  {
    const Rest problem = random_problem(5, 2, random);
    const auto truth = all_solutions(problem);
    const PathWalk found = problem.find({});
    if (found.completed)
    {
      double nearest = HUGE_VAL;
      for (const VectorXd& solution : truth) nearest = std::min(nearest, distance(found.state.r, solution));
      CHECK(nearest < 1e-6);
    }
    CHECK(found.impossible == truth.empty()); // of few pairs
    none += truth.empty() ? 1 : 0;
    several += truth.size() > 1 ? 1 : 0;
    CHECK(found.completed == !truth.empty());
  }
  MESSAGE(none, " without solution, ", several, " with several");
  CHECK(std::min(none, several) > 10); // both were met
}

TEST_CASE("friction that pulls every one of many pairs open is proved to have no rest")
{
  std::mt19937 random(3);
  for (int trial = 0; trial < 20; ++trial)
  {
    Rest problem = random_problem(60, 0.005, random);
    CHECK(problem.find({}).completed);
    CHECK(problem.find(std::vector<char>(60, 0)).completed);
    CHECK_FALSE(has_no_solution(problem.of(), problem.q));
    CHECK(has_one_solution(problem.of()) ==
          (Eigen::SelfAdjointEigenSolver<MatrixXd>(MatrixXd(problem.M + problem.M.transpose()), Eigen::EigenvaluesOnly)
               .eigenvalues()
               .minCoeff() > 0));
    problem.M = -problem.M.cwiseAbs(); // every reaction closes every gap
    CHECK_FALSE(problem.find({}).completed);
    CHECK(has_no_solution(problem.of(), problem.q));
  }
}

TEST_CASE("a gap at rounding counts as closed, whatever the unit of force")
{
  for (const double factor : {1., 1e-6, 1e6})
  {
    // the second pair just touches under the first one's reaction
    const Rest problem{Eigen::Matrix2d{{2 / factor, 1 / factor}, {1 / factor, 2 / factor}},
                       Eigen::Vector2d(-3, -1.5 + 1e-16)};
    const PathWalk found = problem.find({1, 1});
    CHECK(found.completed);
    CHECK(std::abs(found.state.r[0] / factor - 1.5) < 1e-15);
    CHECK(std::abs(found.state.r[1] / factor) < 1e-15);
  }
}

TEST_CASE("pairs that share a rigid face share its load evenly")
{
  const Rest problem{MatrixXd::Ones(3, 3), VectorXd::Constant(3, -6)};
  const PathWalk found = problem.find({1, 1, 1});
  CHECK(found.completed);
  CHECK(distance(found.state.r, VectorXd::Constant(3, 2)) < 1e-9); // the compliance that shares is 1e-10
}
