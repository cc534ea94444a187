// ranks: 1
// Statuses of pairs without a drive along load paths with exact answers, on dense condensed operators.
#include "squeal/equilibrium/path_walk.hpp"

#include <algorithm>
#include <array>
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
    of = make_stick_slip_operator(N, D, D.diagonal(), 1, contact);
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
    std::shared_ptr<const StatusFactors> factors;
    const StickSlipSolution found = solve_stick_slip(node.of, problem.friction, q, guess, factors);
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

TEST_CASE("a bar on a rough base slips from its end on, by the square of the force, and leaves a loop")
{
  constexpr double EA = 1e6, rough = 1e4, length = .1, mu = .5, kappa = 1e6;
  constexpr Index elements = 20, nodes = elements + 1;
  constexpr double size = length / elements;
  MatrixXd K = MatrixXd::Zero(2 * nodes, 2 * nodes), B = MatrixXd::Zero(2 * nodes, 2 * nodes); // x, then y
  VectorXd pressed = VectorXd::Zero(2 * nodes), pulled = VectorXd::Zero(2 * nodes);
  for (Index i = 0; i < nodes; ++i)
  {
    const bool end = i == 0 || i == elements;
    B(2 * i, nodes + i) = B(2 * i + 1, i) = 1;
    pressed[nodes + i] = -rough * size / mu * (end ? .5 : 1);
    if (i < elements) K.block<2, 2>(i, i) += EA / size * rows_of({{1, -1}, {-1, 1}});
  }
  pulled[elements] = 1;
  Planar bar(K, B, std::vector<double>(nodes, mu), kappa);
  bar.step(pressed, 1);
  const auto moved_at = [&](double force)
  {
    bar.step(pressed + force * pulled, 1);
    const PathWalk walk = walk_path(bar.problem());
    REQUIRE(walk.completed);
    return bar.displacement(walk, pressed + force * pulled)[elements];
  };
  constexpr double F = 800, exact = F * F / (2 * EA * rough); // the front is at a node
  CHECK(moved_at(F) == doctest::Approx(exact).epsilon(1e-9));
  const PathWalk pulled_out = walk_path(bar.problem());
  const std::vector<ContactStatus> statuses = StatusSystem(bar.of, pulled_out.friction, pulled_out.state).statuses();
  const auto sticking = std::ranges::count(statuses, ContactStatus::stick);
  CHECK(std::abs(static_cast<double>(nodes - sticking) * size - F / rough) <= size);
  // a parabola each way: the work of F in the loop follows from its ends and its middle
  const double back = moved_at(0), turned = moved_at(-F), forth = moved_at(0), closed = moved_at(F);
  CHECK(turned == doctest::Approx(-exact).epsilon(1e-9));
  CHECK(closed == doctest::Approx(exact).epsilon(1e-9));
  CHECK(4. / 3 * F * (back - forth) == doctest::Approx(2. / 3 * F * F * F / (EA * rough)).epsilon(1e-9));
  bar.step(pressed + 1200 * pulled, 1); // more than friction of the whole bar
  const PathWalk whole = walk_path(bar.problem());
  CHECK_FALSE(whole.completed);
  CHECK(F + whole.part * (1200 - F) == doctest::Approx(rough * length).epsilon(1e-5));
}

namespace
{

/// Two equal spheres without Poisson's ratio on a grid of squares: the half-space's motion by even pressure on each.
struct Spheres
{
  static constexpr double R = 100, approach = .01, mu = .5, G = 1;
  static constexpr Index across = 14;
  double radius = std::sqrt(R * approach), size = 2.1 * radius / across;
  double load = 4. / 3 * std::sqrt(R) * std::pow(approach, 1.5);
  double reach = 3 * mu * load / (16 * radius) * 4 / G; // motion at which all slips
  StickSlipOperator of{};
  std::vector<double> gap{};
  std::vector<PathEnd> ends{};

  Spheres()
  {
    std::vector<std::array<double, 2>> at;
    for (Index i = 0; i < across * across; ++i)
      at.push_back({(static_cast<double>(i % across) - (across - 1) / 2.) * size,
                    (static_cast<double>(i / across) - (across - 1) / 2.) * size});
    const auto pairs = static_cast<Index>(at.size());
    MatrixXd D = MatrixXd::Zero(2 * pairs, 2 * pairs);
    for (Index i = 0; i < pairs; ++i)
      for (Index j = 0; j < pairs; ++j)
      {
        const auto& a = at[static_cast<std::size_t>(i)];
        const auto& b = at[static_cast<std::size_t>(j)];
        D(2 * i, 2 * j) = D(2 * i + 1, 2 * j + 1) =
            square(a[0] - b[0], a[1] - b[1], size / 2) / (M_PI * G * size * size); // of both bodies
      }
    for (const auto& [x, y] : at) gap.push_back((x * x + y * y) / (2 * R));
    of = make_stick_slip_operator(MatrixXd::Identity(2 * pairs, 2 * pairs), D, D.diagonal(), 1,
                                  std::vector<int>(static_cast<std::size_t>(pairs), 0));
    move(0);
  }

  /// The integral of 1/distance over a square of half a side b, from (x, y) of its middle.
  static double square(double x, double y, double b)
  {
    const auto part = [](double u, double v)
    { return u * std::asinh(v / std::abs(u)) + v * std::asinh(u / std::abs(v)); };
    x += 1e-13;
    y += 1.3e-13;
    return part(x + b, y + b) - part(x - b, y + b) - part(x + b, y - b) + part(x - b, y - b);
  }

  void move(double along)
  {
    VectorXd q(of.M.rows());
    for (Index i = 0; i < q.size(); i += 2) q[i] = -approach, q[i + 1] = -along;
    ends.push_back({"move", q, 1});
  }

  PathWalk walk() const
  {
    return walk_path({of, 0, gap, {std::vector<double>(gap.size(), mu), std::vector<double>(gap.size(), 0.)}, ends});
  }
};

double sum_of(const PathWalk& walk, Index component)
{
  double sum = 0;
  for (Index i = component; i < walk.state.r.size(); i += 2) sum += walk.state.r[i];
  return sum;
}

} // namespace

TEST_CASE("two spheres stick inside a ring of slip as Cattaneo and Mindlin say, and unload along another curve")
{
  Spheres spheres;
  const double N = sum_of(spheres.walk(), 0);
  CHECK(N == doctest::Approx(spheres.load).epsilon(1e-2));
  constexpr double part = .6; // of mu N
  spheres.move(spheres.reach * (1 - std::pow(1 - part, 2. / 3)));
  const PathWalk moved = spheres.walk();
  REQUIRE(moved.completed);
  CHECK(sum_of(moved, 1) / (Spheres::mu * N) == doctest::Approx(part).epsilon(1e-2));
  const std::vector<ContactStatus> statuses = StatusSystem(spheres.of, moved.friction, moved.state).statuses();
  const auto sticking = static_cast<double>(std::ranges::count(statuses, ContactStatus::stick));
  CHECK(std::sqrt(sticking / M_PI) * spheres.size / spheres.radius ==
        doctest::Approx(std::cbrt(1 - part)).epsilon(5e-2));
  const double back = 2 * spheres.reach * (1 - std::pow(1 - part / 2, 2. / 3)); // until the force is zero again
  spheres.move(spheres.reach * (1 - std::pow(1 - part, 2. / 3)) - back);
  CHECK(std::abs(sum_of(spheres.walk(), 1)) < 1e-2 * Spheres::mu * N);
}

TEST_CASE("the factors of a status system serve another whose laws differ in few pairs")
{
  // a row of masses on springs, each pressed onto the ground, that is pulled at its end
  constexpr Index masses = 12;
  MatrixXd K = MatrixXd::Zero(2 * masses, 2 * masses), B = K;
  VectorXd pressed = VectorXd::Zero(2 * masses), pulled = pressed;
  for (Index i = 0; i < masses; ++i)
  {
    B(2 * i, masses + i) = B(2 * i + 1, i) = 1;
    K(masses + i, masses + i) = 3;
    K(i, masses + i) = K(masses + i, i) = .2;
    pressed[masses + i] = -1;
    if (i + 1 < masses) K.block<2, 2>(i, i) += rows_of({{2, -2}, {-2, 2}});
  }
  K.topLeftCorner(masses, masses).diagonal().array() += .3;
  pulled[masses - 1] = 1.2;
  Planar row(K, B, std::vector<double>(masses, .4), .5);
  row.step(pressed, 1);
  row.step(pressed + pulled, 1);
  const PathWalk walk = walk_path(row.problem());
  REQUIRE(walk.completed);
  std::shared_ptr<const StatusFactors> factors;
  const StatusSystem first(row.of, walk.friction, walk.state, {}, 0, factors);
  CHECK(std::ranges::count(first.statuses(), ContactStatus::slip) > 0);
  const std::shared_ptr<const StatusFactors> kept = factors;
  StickSlipState other = walk.state; // the first pair opens
  other.w[0] = 1;
  const VectorXd rhs = VectorXd::LinSpaced(2 * masses, -1, 2);
  const StatusSystem anew(row.of, walk.friction, other);
  const StickSlipState near = StatusSystem(row.of, walk.friction, other, {}, 0, factors).change(rhs, {}),
                       own = anew.change(rhs, {});
  CHECK(factors == kept);
  CHECK(first.statuses() != anew.statuses());
  CHECK(distance(near.r, own.r) < 1e-10); // rounding: another order of elimination
  CHECK(distance(near.w, own.w) < 1e-10);
}
