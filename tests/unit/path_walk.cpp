// ranks: 1
// Statuses of pairs without a drive along load paths with exact answers, on dense condensed operators.
#include "squeal/equilibrium/path_walk.hpp"

#include <cmath>
#include <doctest/doctest.h>
#include <Eigen/Dense>
#include <numeric>

using namespace squeal;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace
{

/// A structure of a few motions with planar pairs; mu below zero: the pair is driven along its tangent.
struct Planar
{
  MatrixXd K, B;
  std::vector<double> mu;
  double kappa = 1;
  StickSlipOperator of{};
  std::vector<PathEnd> ends{};

  Planar(MatrixXd K_, MatrixXd B_, std::vector<double> mu_, double kappa_)
      : K(std::move(K_)), B(std::move(B_)), mu(std::move(mu_)), kappa(kappa_)
  {
    const MatrixXd D = B * held().ldlt().solve(B.transpose());
    MatrixXd N = MatrixXd::Identity(D.rows(), D.cols()) - kappa * D;
    N = (N.array().abs() < 1e-13).select(0, N);
    std::vector<int> contact(mu.size());
    std::iota(contact.begin(), contact.end(), 0);
    of = make_stick_slip_operator(N, D, 1, contact);
  }

  MatrixXd held() const { return K + kappa * B.transpose() * B; }

  void step(const VectorXd& F, double driven_friction)
  {
    ends.push_back({"step " + std::to_string(ends.size()), B * held().ldlt().solve(F), driven_friction});
  }

  PathProblem problem() const
  {
    StickSlipFriction friction;
    for (const double value : mu)
    {
      friction.mu.push_back(std::abs(value));
      friction.e.push_back(value < 0 ? 1 : 0);
    }
    return {of, kappa, std::vector<double>(mu.size(), 0.), friction, ends};
  }

  VectorXd displacement(const PathWalk& walk, const VectorXd& F) const
  {
    return held().ldlt().solve(F + B.transpose() * (walk.state.r + kappa * (walk.state.w - walk.offset)));
  }
};

VectorXd vector_of(std::initializer_list<double> values)
{
  return VectorXd::Map(values.begin(), static_cast<Index>(values.size()));
}

MatrixXd rows_of(std::initializer_list<std::initializer_list<double>> rows)
{
  MatrixXd result(static_cast<Index>(rows.size()), static_cast<Index>(rows.begin()->size()));
  Index i = 0;
  for (const auto& row : rows) result.row(i++) = vector_of(row).transpose();
  return result;
}

double distance(const VectorXd& a, const VectorXd& b)
{
  return (a - b).lpNorm<Eigen::Infinity>();
}

} // namespace

TEST_CASE("Klarbring's node: it sticks as long as friction allows, and no continuation is made up beyond")
{
  const MatrixXd K = rows_of({{1, .5}, {.5, 1}}); // motions n, t
  Planar node(K, MatrixXd::Identity(2, 2), {3}, 1);
  node.step(vector_of({-1, 0}), 1);
  node.step(vector_of({-1, -2.9}), 1);
  const PathWalk walk = walk_path(node.problem());
  REQUIRE(walk.completed);
  CHECK(distance(walk.state.r, vector_of({1, 2.9})) < 1e-12);
  CHECK(StatusSystem(node.of, walk.friction, walk.state).index() == 1);
  Planar beyond(K, MatrixXd::Identity(2, 2), {3}, 1);
  beyond.step(vector_of({-1, 0}), 1);
  beyond.step(vector_of({-1, -4}), 1);
  const PathWalk ended = walk_path(beyond.problem());
  CHECK_FALSE(ended.completed);
  INFO(ended.reason);
  CHECK_FALSE(ended.reason.empty());
}

TEST_CASE("Klarbring's node at one load: the slip branch has the index that no rate follows")
{
  Planar node(rows_of({{1, .5}, {.5, 1}}), MatrixXd::Identity(2, 2), {3}, 1);
  node.step(vector_of({-1, -2.9}), 1);
  const PathProblem problem = node.problem();
  const VectorXd q = problem.ends[0].q;
  const auto from = [&](const StickSlipState& guess)
  {
    const StickSlipSolution found = solve_stick_slip(node.of, problem.friction, q, guess);
    CHECK(found.converged);
    return std::pair{found.state, StatusSystem(node.of, problem.friction, found.state).index()};
  };
  const auto [open, of_open] = from({vector_of({0, 0}), vector_of({.6, -3.2})});
  const auto [stick, of_stick] = from({vector_of({1, 2.9}), vector_of({0, 0})});
  const auto [slip, of_slip] = from({vector_of({.9, 2.7}), vector_of({0, -.2})});
  CHECK(distance(open.w, vector_of({.6, -3.2})) < 1e-12);
  CHECK(distance(stick.r, vector_of({1, 2.9})) < 1e-12);
  CHECK(distance(slip.r, vector_of({.9, 2.7})) < 1e-12);
  CHECK(distance(slip.w, vector_of({0, -.2})) < 1e-12);
  CHECK(of_open + of_stick + of_slip == 1);
  CHECK(of_slip == -1);
}

TEST_CASE("a pad in its abutment: the clamp force depends on the path as friction locks it in")
{
  // pad x, y, disc y, bracket x; nothing else holds the pad
  constexpr double mu = .4, disc = 5e7, bracket = 3e7;
  const MatrixXd K = vector_of({0, 0, disc, bracket}).asDiagonal();
  const MatrixXd B = rows_of({{0, 1, -1, 0}, {1, 0, 0, 0}, {-1, 0, 0, 1}, {0, 1, 0, 0}});
  const auto pressed = [](double force) { return vector_of({0, -force, 0, 0}); };
  const auto clamp_of = [&](const std::vector<std::pair<double, double>>& steps)
  {
    Planar pad(K, B, {-mu, mu}, 1e-2 * disc);
    for (const auto& [force, friction] : steps) pad.step(pressed(force), friction);
    const PathWalk walk = walk_path(pad.problem());
    REQUIRE(walk.completed);
    const VectorXd F = pressed(steps.back().first), u = pad.displacement(walk, F);
    CHECK((K * u - F - B.transpose() * walk.state.r).norm() < 1e-12 * F.norm());
    return walk.state.r[0];
  };
  CHECK(clamp_of({{1000, 1}}) == doctest::Approx(1000 / 1.16).epsilon(1e-10));
  CHECK(clamp_of({{1000, 1}, {730, 1}}) == doctest::Approx(1000 / 1.16).epsilon(1e-10));
  CHECK(clamp_of({{1000, 1}, {500, 1}}) == doctest::Approx(500 / .84).epsilon(1e-10));
  CHECK(clamp_of({{1000, 0}, {1000, 1}}) == doctest::Approx(1000).epsilon(1e-10));
}

TEST_CASE("two blocks: what is locked in depends on the order of pressing and shearing")
{
  constexpr double k = 1e6;
  const MatrixXd K = vector_of({k, 0, k, 0}).asDiagonal(); // x1 y1 x2 y2
  const MatrixXd B = rows_of({{0, 1, 0, 0}, {1, 0, 0, 0}, {0, -1, 0, 1}, {-1, 0, 1, 0}});
  const VectorXd N = vector_of({0, 0, 0, -100}), H = vector_of({0, 0, 60, 0});
  const auto reached = [&](const std::vector<VectorXd>& loads)
  {
    Planar stack(K, B, {.2, .5}, 1e-2 * k);
    for (const VectorXd& load : loads) stack.step(load, 1);
    const PathWalk walk = walk_path(stack.problem());
    REQUIRE(walk.completed);
    const VectorXd u = stack.displacement(walk, loads.back());
    return std::pair{VectorXd(vector_of({walk.state.r[1], walk.state.r[3]})), VectorXd(k * vector_of({u[0], u[2]}))};
  };
  const auto [sheared, moved] = reached({N, N + H});
  CHECK(distance(sheared, vector_of({-20, -40})) < 1e-10);
  CHECK(distance(moved, vector_of({20, 20})) < 1e-10);
  const auto [released, back] = reached({N, N + H, N});
  CHECK(distance(released, vector_of({20, 10})) < 1e-10);
  CHECK(distance(back, vector_of({10, 10})) < 1e-10);
  const auto [after, pushed] = reached({H, N + H});
  CHECK(distance(after, vector_of({0, 0})) < 1e-10);
  CHECK(distance(pushed, vector_of({0, 60})) < 1e-10);
}

TEST_CASE("a wedge stays where it was driven, when its angle is that of friction at most")
{
  constexpr double k = 1e6, F = 1000, a = 10 * M_PI / 180;
  const MatrixXd K = vector_of({0, k, k}).asDiagonal();
  const double s = std::sin(a), c = std::cos(a);
  const MatrixXd B = rows_of({{-s, 1, 0}, {-c, 0, 0}, {-s, 0, 1}, {-c, 0, 0}});
  for (const double mu : {.17, .18})
  {
    Planar wedge(K, B, {mu, mu}, 1e-2 * k);
    wedge.step(vector_of({F, 0, 0}), 1);
    const PathWalk driven = walk_path(wedge.problem());
    REQUIRE(driven.completed);
    const double N = F / (2 * (s + mu * c));
    CHECK(driven.state.r[0] == doctest::Approx(N).epsilon(1e-9));
    wedge.step(vector_of({0, 0, 0}), 1);
    const PathWalk released = walk_path(wedge.problem());
    REQUIRE(released.completed);
    const bool stays = std::tan(a) < mu;
    CHECK(released.state.r[0] / N == doctest::Approx(stays ? 1 : 0).epsilon(1e-9));
    if (stays) CHECK(std::abs(released.state.r[1] + released.state.r[3]) / 2 == doctest::Approx(N * std::tan(a)));
  }
}

TEST_CASE("a block slides or tips when it is pushed: the certificate proves it from both sides of the limit")
{
  constexpr double width = .2, W = 100;
  for (const auto& [mu, height] : {std::pair{.4, .1}, {.4, .15}, {.8, .15}})
    for (const double part : {.99, 1.01})
    {
      const double limit = std::min(mu * W, W * width / (2 * height));
      const MatrixXd B =
          rows_of({{0, 1, -width / 2}, {1, 0, 0}, {0, 1, width / 2}, {1, 0, 0}}); // x, y, rotation about the foot
      // feet on springs, which leave the block its three motions
      MatrixXd K = MatrixXd::Zero(7, 7), own = MatrixXd::Zero(4, 7);
      own.leftCols(3) = B;
      for (Index i = 0; i < 4; ++i)
      {
        own(i, 3 + i) = -1;
        K(3 + i, 3 + i) = 1e6;
      }
      Planar block(K, own, {mu, mu}, 1e4);
      VectorXd F = VectorXd::Zero(7);
      F.head(3) = vector_of({0, -W, 0});
      block.step(F, 1);
      F.head(3) = vector_of({part * limit, -W, -part * limit * height});
      block.step(F, 1);
      const PathProblem problem = block.problem();
      const auto motion = unresisted_motion(problem, problem.friction, problem.ends.back().q);
      const PathWalk walk = walk_path(problem);
      INFO(walk.reason);
      CHECK(walk.completed == (part < 1));
      CHECK(motion.has_value() == (part > 1));
      if (part > 1) CHECK(walk.part == doctest::Approx(1 / part).epsilon(1e-4));
    }
}

TEST_CASE("a pad clamped between a driven face and a joint slides away where friction of the joint is used up")
{
  // the joint holds .39 N, the disc drags with .4 N: the end is at .975 of the driven friction
  const MatrixXd K = vector_of({0, 0, 5e7, 3e7, 3e7}).asDiagonal(); // pad x, y, disc y, joint's face x, y
  const MatrixXd B = rows_of({{0, 1, -1, 0, 0}, {1, 0, 0, 0, 0}, {0, -1, 0, 0, 1}, {1, 0, 0, -1, 0}});
  Planar pad(K, B, {-.4, .39}, 5e5);
  const VectorXd clamp = vector_of({0, 0, 1000, 0, -1000});
  pad.step(clamp, 0);
  pad.step(clamp, 1);
  const PathWalk walk = walk_path(pad.problem());
  CHECK_FALSE(walk.completed);
  CHECK(walk.step == 1);
  CHECK(walk.part == doctest::Approx(.975).epsilon(1e-5));
}
