// What a sweep is made of: zeros in brackets, eigenvalues with both of their vectors.
#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/root.hpp"

#include <cmath>
#include <doctest/doctest.h>
#include <random>

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
    const std::vector<TwoSidedPair> pairs = solve_two_sided_shared(PETSC_COMM_WORLD, M, C, K);
    REQUIRE(static_cast<int>(pairs.size()) >= n);
    const std::vector<DenseEigenpair> right_only = solve_dense_quadratic(M, C, K);
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
