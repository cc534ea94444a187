// What a sweep is made of: zeros in brackets, eigenvalues with both vectors and with losses, thresholds of modes.
#include "../../src/study/point_modes.hpp"
#include "squeal/algebra/root.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <Eigen/QR>
#include <random>
#include <span>

using namespace squeal;
using Complex = std::complex<double>;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

TEST_CASE("a zero is enclosed to the tolerance, whatever the function's shape")
{
  const auto curves = {+[](double x) { return x - 0.3; }, +[](double x) { return std::cbrt(x - 0.3); },
                       +[](double x) { return std::pow(x, 9) - std::pow(0.3, 9); },
                       +[](double x) { return x < 0.3 ? -1e-12 : 1.0; }};
  for (const auto curve : curves)
    for (const auto& [a, b] : {std::pair{-1.0, 2.0}, {2.0, -1.0}, {0.0, 0.31}})
    {
      int calls = 0;
      const auto counted = [&](double x) -> std::optional<double>
      {
        ++calls;
        return curve(x);
      };
      const Root root = find_root(counted, {a, b, curve(a), curve(b)}, 1e-6);
      CHECK(root.error <= 1e-6);
      CHECK(std::abs(root.x - 0.3) <= root.error);
      const auto& [at_a, at_b, value_a, value_b] = root.bracket; // on the sides that a and b were on
      CHECK((at_a - 0.3) * (a - 0.3) >= 0);
      CHECK((at_b - 0.3) * (b - 0.3) >= 0);
      CHECK((curve(at_a) == value_a && curve(at_b) == value_b));
      // four values halve the bracket at least: 22 halvings of a length of 3
      CHECK(calls <= 4 * 22);
    }
}

TEST_CASE("a function without a value ends the search with the bracket that is known")
{
  const Root root = find_root([](double) { return std::optional<double>(); }, {0, 1, -1, 3}, 1e-6);
  CHECK(root.error == 1);
  CHECK(root.x == doctest::Approx(0.25));
}

TEST_CASE("pairs take losses, with both vectors, whatever the bases of the two sides")
{
  std::mt19937 generator(5);
  std::uniform_real_distribution<double> random(-1, 1);
  const int n = 40;
  const auto matrix = [&] { return MatrixXd::NullaryExpr(n, n, [&] { return random(generator); }).eval(); };
  const auto rotation = [&] { return MatrixXd(Eigen::HouseholderQR<MatrixXd>(matrix()).householderQ()); };
  const MatrixXd M = MatrixXd::Identity(n, n) + 0.2 / n * matrix(), C = 0.05 * matrix(), part = matrix();
  MatrixXd K = 3 * matrix();
  K.diagonal() += Eigen::VectorXd::LinSpaced(n, 10, 400);
  const MatrixXd P = rotation(), R = rotation(), K_loss = 0.2 * K + part * part.transpose() / n;
  const LossyMatrices problem{P * M * R, P * C * R, P * K * R, P * K_loss * R};
  const std::size_t count =
      solve_dense_quadratic_shared(PETSC_COMM_WORLD, problem[0], problem[1], problem[2], Vectors::both).size();
  const std::vector<DenseEigenpair> pairs = solve_lossy_shared(PETSC_COMM_WORLD, problem, Vectors::both, HUGE_VAL);
  REQUIRE(pairs.size() == count);
  for (std::size_t i = 0; i < count; ++i)
  {
    const auto& [lambda, right, left] = pairs[i];
    const MatrixXcd Q = sum(problem, loss_factors(lambda));
    const double settled = 1e-11 * (std::norm(lambda) * M.norm() + K.norm());
    CHECK((Q * right).norm() < settled);
    CHECK((left.transpose() * Q).norm() < settled);
    for (std::size_t j = 0; j < i; ++j) CHECK(std::abs(lambda - pairs[j].lambda) > 1e-6 * std::abs(lambda));
  }
}

TEST_CASE("pairs below a limit of a larger problem take their losses, each its own")
{
  std::mt19937 generator(9);
  std::uniform_real_distribution<double> random(-1, 1);
  const int n = 240;
  const auto matrix = [&] { return MatrixXd::NullaryExpr(n, n, [&] { return random(generator); }).eval(); };
  const MatrixXd M = MatrixXd::Identity(n, n), C = 1e-2 * matrix(), part = matrix().leftCols(40);
  MatrixXd K = Eigen::VectorXd::LinSpaced(n, 10, 2400).asDiagonal();
  K.bottomRightCorner(180, 180) *= 1e4;
  K.block(20, 20, 2, 2) << 210, 5, -5, 220.001; // beside lock-in
  K += 1e-2 * matrix();
  const LossyMatrices problem{M, C, K, 0.05 * K + 0.1 * part * part.transpose()};
  const double limit = 26; // of the lower quarter: the others are far away
  std::vector<DenseEigenpair> pairs = solve_lossy_shared(PETSC_COMM_WORLD, problem, Vectors::both, limit);
  std::erase_if(pairs, [&](const DenseEigenpair& pair) { return std::abs(pair.lambda) > limit; });
  std::vector<DenseEigenpair> all = solve_lossy_shared(PETSC_COMM_WORLD, problem, Vectors::both, HUGE_VAL);
  std::erase_if(all, [&](const DenseEigenpair& pair) { return std::abs(pair.lambda) > limit; });
  CHECK(pairs.size() == all.size());
  REQUIRE(pairs.size() >= 55);
  for (std::size_t i = 0; i < pairs.size(); ++i)
  {
    const auto& [lambda, right, left] = pairs[i];
    INFO("lambda ", lambda.real(), " ", lambda.imag());
    const MatrixXcd Q = sum(problem, loss_factors(lambda));
    const Complex change = (left.transpose() * Q * right).value() /
                           (left.transpose() * (2. * lambda * M + C) * right).value(); // by the two-sided quotient
    CHECK(std::abs(change) < 1e-12 * std::abs(lambda)); // 1e-10 of either side, which count by product
    double of_right = 0, of_left = 0;                   // sizes of the terms, to which residuals are 1e-10 as asked for
    for (std::size_t k = 0; k < 4; ++k)
    {
      const double factor = std::abs(loss_factors(lambda)[k]);
      of_right += factor * (problem[k] * right).norm();
      of_left += factor * (problem[k].transpose() * left).norm();
    }
    CHECK((Q * right).norm() < 1.1e-10 * of_right);
    CHECK((left.transpose() * Q).norm() < 1.1e-10 * of_left);
    for (std::size_t j = 0; j < i; ++j) CHECK(std::abs(lambda - pairs[j].lambda) > 1e-6 * std::abs(lambda));
  }
}

TEST_CASE("modes keep themselves as they take losses, however near to lock-in and however little damped without")
{
  std::mt19937 generator(3);
  std::uniform_real_distribution<double> random(-1, 1);
  const int n = 60;
  const auto matrix = [&] { return MatrixXd::NullaryExpr(n, n, [&] { return random(generator); }).eval(); };
  const MatrixXd M = MatrixXd::Identity(n, n), damping = matrix(), coupling = matrix();
  MatrixXd part = matrix().leftCols(10);
  for (const double distance : {1e-1, 1e-3, -1e-3, -1e-1})
    for (const double damped : {1e-2, 1e-4, 1e-6, 1e-8})
    {
      MatrixXd K = Eigen::VectorXd::LinSpaced(n, 10, 600).asDiagonal();
      K.bottomRightCorner(30, 30) *= 1e4;
      K.block(20, 20, 2, 2) << 210, 5, -5, 220 + 10 * distance; // the two meet at distance 0
      K += damped * coupling;
      const LossyMatrices problem{M, damped * damping, K, 1e-2 * K + 0.1 * part * part.transpose()};
      const std::vector<DenseEigenpair> pairs = solve_lossy_shared(PETSC_COMM_WORLD, problem, Vectors::both, HUGE_VAL);
      CHECK(pairs.size() == static_cast<std::size_t>(n));
      for (std::size_t i = 0; i < pairs.size(); ++i)
      {
        const auto& [lambda, right, left] = pairs[i];
        INFO("distance ", distance, " damped ", damped, " lambda ", lambda.real(), " ", lambda.imag());
        const MatrixXcd Q = sum(problem, loss_factors(lambda));
        const double size = std::norm(lambda) + std::abs(lambda) * damped + K.norm();
        CHECK((Q * right).norm() < 1e-11 * size);
        CHECK((left.transpose() * Q).norm() < 1e-11 * size);
        for (std::size_t j = 0; j < i; ++j) CHECK(std::abs(lambda - pairs[j].lambda) > 1e-6 * std::abs(lambda));
      }
    }
}

TEST_CASE("near neighbours that a loss factor mixes stay two")
{
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> random(-1, 1);
  const int n = 40;
  const auto matrix = [&] { return MatrixXd::NullaryExpr(n, n, [&] { return random(generator); }).eval(); };
  const MatrixXd M = MatrixXd::Identity(n, n), damping = 1e-2 * matrix(), friction = matrix();
  for (const double apart : {1e-2, 1e-3, 1e-4, 1e-5})
    for (const double eta : {1e-4, 1e-3, 1e-2, 1e-1, 0.5})
      for (const double angle : {0.1, 0.4, 0.7}) // of the lossy direction between the two neighbours
      {
        INFO("apart ", apart, " eta ", eta, " angle ", angle);
        MatrixXd K = Eigen::VectorXd::LinSpaced(n, 10, 400).asDiagonal();
        K(20, 20) = K(19, 19) * (1 + apart);
        K += 1e-4 * friction;
        Eigen::VectorXd part = Eigen::VectorXd::Zero(n);
        part(19) = std::cos(angle);
        part(20) = std::sin(angle);
        const LossyMatrices problem{M, damping, K, eta * K(19, 19) * part * part.transpose()};
        const std::vector<DenseEigenpair> pairs =
            solve_lossy_shared(PETSC_COMM_WORLD, problem, Vectors::both, HUGE_VAL);
        const std::vector<DenseEigenpair> modes = solve_lossy_shared(PETSC_COMM_WORLD, problem);
        REQUIRE(pairs.size() == static_cast<std::size_t>(n));
        REQUIRE(modes.size() == static_cast<std::size_t>(n));
        for (std::size_t i = 0; i < pairs.size(); ++i)
        {
          const auto& [lambda, right, left] = pairs[i];
          CHECK((sum(problem, loss_factors(lambda)) * right).norm() < 1e-11 * (std::norm(lambda) + K.norm()));
          for (std::size_t j = 0; j < i; ++j)
          {
            CHECK(std::abs(lambda - pairs[j].lambda) > 1e-9 * std::abs(lambda));
            CHECK(std::abs(modes[i].lambda - modes[j].lambda) > 1e-9 * std::abs(lambda));
          }
        }
      }
}

TEST_CASE("pairs below a limit are those of the whole problem, with both vectors, where two coincide as well")
{
  std::mt19937 generator(13);
  std::uniform_real_distribution<double> random(-1, 1);
  const int half = 100, n = 2 * half; // of 400 eigenvalues 24 are below the limit
  const MatrixXd M = MatrixXd::Identity(n, n);
  for (const double friction : {0.0, 1.0, 20.0})
  {
    MatrixXd one = friction * MatrixXd::NullaryExpr(half, half, [&] { return random(generator); });
    one.diagonal() += Eigen::VectorXd::LinSpaced(half, 1, half).cwiseAbs2();
    const MatrixXd damping = 0.1 * MatrixXd::NullaryExpr(half, half, [&] { return random(generator); });
    MatrixXd K = MatrixXd::Zero(n, n), C = K; // two structures alike
    for (const int first : {0, half})
    {
      K.block(first, first, half, half) = one;
      C.block(first, first, half, half) = damping;
    }
    const double limit = 6.5;
    std::vector<DenseEigenpair> all = solve_dense_quadratic_shared(PETSC_COMM_WORLD, M, C, K, Vectors::both),
                                some = solve_dense_quadratic_shared(PETSC_COMM_WORLD, M, C, K, Vectors::both, limit);
    CHECK(some.size() < all.size() / 2);
    for (std::vector<DenseEigenpair>* pairs : {&all, &some})
      std::erase_if(*pairs, [&](const DenseEigenpair& pair) { return std::abs(pair.lambda) > limit; });
    REQUIRE(some.size() == all.size());
    for (const auto& [lambda, right, left] : some)
    {
      double nearest = HUGE_VAL;
      for (const DenseEigenpair& pair : all) nearest = std::min(nearest, std::abs(pair.lambda - lambda));
      CHECK(nearest < 1e-8 * std::abs(lambda)); // the root of rounding, where two coincide
      const MatrixXcd Q = lambda * lambda * M + lambda * C + K;
      CHECK((Q * right).norm() < 1e-13 * K.norm());
      CHECK((left.transpose() * Q).norm() < 1e-13 * K.norm());
    }
  }
}

TEST_CASE("one loss factor everywhere gives the closed form of complex stiffness")
{
  const MatrixXd one = MatrixXd::Identity(1, 1), none = MatrixXd::Zero(1, 1);
  const double w = 7;
  for (const double eta : {0.02, 0.3, 5.})
  {
    const LossyMatrices problem{one, none, w * w * one, eta * w * w * one};
    const std::vector<DenseEigenpair> pairs = solve_lossy_shared(PETSC_COMM_WORLD, problem, Vectors::both, HUGE_VAL);
    REQUIRE(pairs.size() == 1);
    const Complex exact = Complex(0, w) * std::sqrt(Complex(1, eta));
    CHECK(std::abs(pairs[0].lambda - exact) < 1e-13 * w);
  }
}

TEST_CASE("what is overdamped without losses does not vibrate with them, and what diverges stays as it is")
{
  MatrixXd M = MatrixXd::Identity(4, 4), C = MatrixXd::Zero(4, 4), K = MatrixXd::Zero(4, 4);
  K.diagonal() << 9, 16, 1, -4;
  C(2, 2) = 50;
  const LossyMatrices problem{M, C, K, 0.1 * K.cwiseAbs()};
  std::vector<DenseEigenpair> pairs = solve_lossy_shared(PETSC_COMM_WORLD, problem, Vectors::both, HUGE_VAL);
  const auto real = std::ranges::stable_partition(pairs, [](const auto& pair) { return pair.lambda.imag() > 0; });
  REQUIRE(pairs.size() == 6);
  REQUIRE(real.size() == 4);
  for (const auto& [lambda, right, left] : std::span(pairs).first(2))
  {
    const double w = std::abs(lambda.imag() - 3) < 0.5 ? 3 : 4;
    CHECK(std::abs(lambda - Complex(0, w) * std::sqrt(Complex(1, 0.1))) < 1e-12);
  }
  CHECK(std::ranges::count_if(real, [](const auto& pair) { return std::abs(pair.lambda - 2.) < 1e-12; }) == 1);
}

TEST_CASE("left and right vectors of unsymmetric quadratic problems solve them, and are biorthogonal")
{
  std::mt19937 generator(11);
  std::uniform_real_distribution<double> random(-1, 1);
  for (const int n : {1, 2, 7, 20})
  {
    const auto matrix = [&] { return MatrixXd::NullaryExpr(n, n, [&] { return random(generator); }).eval(); };
    const MatrixXd M = MatrixXd::Identity(n, n) + 0.2 / n * matrix(), C = 0.05 * matrix();
    MatrixXd K = 3 * matrix();
    K.diagonal() += Eigen::VectorXd::LinSpaced(n, 10, 100);
    const std::vector<DenseEigenpair> pairs = solve_dense_quadratic_shared(PETSC_COMM_WORLD, M, C, K, Vectors::both);
    REQUIRE(static_cast<int>(pairs.size()) >= n);
    const std::vector<DenseEigenpair> right_only = solve_dense_quadratic_shared(PETSC_COMM_SELF, M, C, K);
    REQUIRE(right_only.size() == pairs.size());
    for (std::size_t i = 0; i < pairs.size(); ++i)
    {
      const auto& [lambda, right, left] = pairs[i];
      const MatrixXcd Q = lambda * lambda * M + lambda * C + K;
      // the QR algorithm is backward stable: a modest multiple of 1e-16 times the sizes of the three terms
      const double rounding =
          1e-12 * (std::norm(lambda) * M.norm() + std::abs(lambda) * C.norm() + K.norm()) * right.norm();
      CHECK((Q * right).norm() < rounding);
      CHECK((left.transpose() * Q).norm() * right.norm() < rounding * left.norm());
      for (std::size_t j = 0; j < pairs.size(); ++j)
      {
        const Complex form = (left.transpose() * ((lambda + pairs[j].lambda) * M + C) * pairs[j].right).value();
        if (i != j) CHECK(std::abs(form) < 1e-9);
        if (i == j) CHECK(std::abs(form) > 1e-3);
      }
    }
  }
}

namespace
{

/// Modes of these growth rates at a value.
Followed followed(double value, const std::vector<double>& growth)
{
  Followed point{{{value}}};
  for (std::size_t k = 0; k < growth.size(); ++k) point.modes.pairs.push_back({{growth[k], 1.0 + k}, {}, {}});
  return point;
}

/// Three that are matched as one subspace: its members are told apart on short steps alone, and swapped on long ones.
std::vector<Match> as_subspace(const Followed& from, const Followed& to)
{
  const bool near = std::abs(from.values[0] - to.values[0]) < 0.1;
  return {{near ? 0 : 1, 1, 3}, {near ? 1 : 0, 1, 3}, {2, 1, 3}};
}

} // namespace

TEST_CASE("thresholds of a subspace are where numbers of unstable modes change, however its members are matched")
{
  // one mode becomes unstable at 0.3 and another stable at 0.7; then one at 0.3 beside one that is unstable throughout
  const auto growths = {+[](double x) -> std::vector<double> {
                          return {x - 0.3, -0.1 - x, 0.7 - x};
                        },
                        +[](double x) -> std::vector<double> {
                          return {std::cbrt(x - 0.3), 2 + x, -1};
                        }};
  const std::vector<std::vector<std::pair<double, int>>> wanted = {{{0.3, 1}, {0.7, -1}}, {{0.3, 1}}};
  for (std::size_t way = 0; const auto growth : growths)
  {
    for (const auto& [a, b] : {std::pair{0.0, 1.0}, {1.0, 0.0}})
    {
      int tracks = 3, points = 0;
      const auto point_at = [&](double x) -> std::optional<Followed>
      {
        ++points;
        return followed(x, growth(x));
      };
      Followed before = followed(a, growth(a)), now = followed(b, growth(b));
      before.tracks = {0, 1, 2};
      std::vector<Threshold> found =
          find_thresholds({point_at, as_subspace, 10, 1e-5, tracks}, before, now, as_subspace(before, now));
      std::ranges::sort(found, {}, [](const Threshold& threshold) { return threshold.values[0]; });
      REQUIRE(found.size() == wanted[way].size());
      for (std::size_t k = 0; k < found.size(); ++k)
      {
        CHECK(std::abs(found[k].values[0] - wanted[way][k].first) <= found[k].error);
        CHECK(found[k].error <= 1.1e-5);
        CHECK(found[k].change == wanted[way][k].second);
      }
      CHECK(points < 100);
    }
    ++way;
  }
}
