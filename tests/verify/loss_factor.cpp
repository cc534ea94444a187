// ranks: 1 2
// Modes with loss factors: those of complex stiffness. With one eta everywhere they are i w sqrt(1 + i eta), w the
// undamped frequency. With several eta the problem is solved dense.
#include "../support/linearised.hpp"
#include "squeal/solid/structure.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <numbers>

using namespace squeal;
using Complex = std::complex<double>;

namespace
{

/// Unit masses in a row between walls, springs of stiffness s with a loss factor each, C_0 = alpha M.
struct Row
{
  std::vector<double> loss; // of the springs, one more than masses
  double s = 1, alpha = 0, loss_omega = 1;
  std::vector<double> share{}; // of s that a spring has; empty: all of it

  int masses() const { return static_cast<int>(loss.size()) - 1; }
  std::vector<double> shares() const { return share.empty() ? std::vector<double>(loss.size(), 1) : share; }
  std::vector<double> lossy() const
  {
    std::vector<double> weight = shares();
    for (std::size_t i = 0; i < loss.size(); ++i) weight[i] *= loss[i];
    return weight;
  }
};

/// Entries (i, j) of the springs' matrix, each spring weighted.
double stiffness(const Row& row, const std::vector<double>& weight, int i, int j)
{
  const auto at = static_cast<std::size_t>(i);
  if (i == j) return row.s * (weight[at] + weight[at + 1]);
  return std::abs(i - j) == 1 ? -row.s * weight[static_cast<std::size_t>(std::max(i, j))] : 0;
}

Eigen::MatrixXd dense(const Row& row, const std::vector<double>& weight)
{
  const Eigen::Index n = row.masses();
  return Eigen::MatrixXd::NullaryExpr(n, n,
                                      [&](Eigen::Index i, Eigen::Index j)
                                      { return stiffness(row, weight, static_cast<int>(i), static_cast<int>(j)); });
}

template <class Entry> Owned<Mat> matrix(int n, Entry entry)
{
  Owned<Mat> A;
  check(MatCreateAIJ(PETSC_COMM_WORLD, PETSC_DECIDE, PETSC_DECIDE, n, n, 3, nullptr, 3, nullptr, A.put()));
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(A, &first, &last));
  for (PetscInt i = first; i < last; ++i)
    for (PetscInt j = std::max(PetscInt{0}, i - 1); j < std::min(PetscInt{n}, i + 2); ++j)
      check(MatSetValue(A, i, j, entry(static_cast<int>(i), static_cast<int>(j)), INSERT_VALUES));
  check(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  check(MatSetOption(A, MAT_SYMMETRIC, PETSC_TRUE));
  return A;
}

Modes modes_of(const Row& row, double band)
{
  test::SmallModel model;
  Structure& structure = model.structure;
  const std::vector<double> shares = row.shares(), lossy = row.lossy();
  const int n = row.masses();
  structure.M = matrix(n, [](int i, int j) { return i == j ? 1. : 0.; });
  structure.K = matrix(n, [&](int i, int j) { return stiffness(row, shares, i, j); });
  structure.K_loss = matrix(n, [&](int i, int j) { return stiffness(row, lossy, i, j); });
  structure.loss_omega = row.loss_omega;
  structure.C =
      matrix(n, [&](int i, int j) { return (i == j ? row.alpha : 0) + stiffness(row, lossy, i, j) / row.loss_omega; });
  check(MatCreateVecs(structure.K, structure.load.put(), nullptr));
  PetscInt local = 0;
  check(MatGetLocalSize(structure.K, &local, nullptr));
  model.interface.B = matrix_of_rows({}, local, PETSC_COMM_WORLD);
  ModesSettings settings;
  settings.band = band;
  return test::modes_of(model, find_equilibrium(model.structure, model.interface, {}), settings, {});
}

std::vector<const ComplexMode*> by_frequency(const Modes& modes)
{
  std::vector<const ComplexMode*> result;
  for (const ComplexMode& mode : modes.modes) result.push_back(&mode);
  std::sort(result.begin(), result.end(),
            [](const ComplexMode* a, const ComplexMode* b) { return a->lambda.imag() < b->lambda.imag(); });
  return result;
}

Complex nearest(const std::vector<Complex>& values, Complex to)
{
  return *std::min_element(values.begin(), values.end(),
                           [&](Complex a, Complex b) { return std::abs(a - to) < std::abs(b - to); });
}

/// (lambda^2 + lambda C + K) of dense matrices.
std::vector<Complex> dense_pairs(const Eigen::MatrixXcd& C, const Eigen::MatrixXcd& K)
{
  const Eigen::Index n = K.rows();
  Eigen::MatrixXcd companion(2 * n, 2 * n);
  companion << -C, -K, Eigen::MatrixXcd::Identity(n, n), Eigen::MatrixXcd::Zero(n, n);
  const Eigen::VectorXcd values = Eigen::ComplexEigenSolver<Eigen::MatrixXcd>(companion, false).eigenvalues();
  return {values.begin(), values.end()};
}

} // namespace

TEST_CASE("one loss factor everywhere gives complex stiffness in closed form, whatever frequency C is stated at")
{
  for (const int n : {8, 1500}) // solved whole, and by slices
    for (const double eta : {0.02, 0.4})
      for (const double stated : {20., 300.})
      {
        CAPTURE(n);
        CAPTURE(eta);
        Row row{std::vector<double>(static_cast<std::size_t>(n) + 1, eta), n == 8 ? 2e4 : 1e8, 0, stated};
        const Modes modes = modes_of(row, n == 8 ? 1000 : 150);
        CHECK(modes.outcome.kind == OutcomeKind::converged);
        CHECK(modes.outcome.residual < 1e-12);
        const auto ordered = by_frequency(modes);
        REQUIRE(ordered.size() > 7);
        int j = 0;
        for (const ComplexMode* mode : ordered)
        {
          const double w = 2 * std::sqrt(row.s) * std::sin(++j * std::numbers::pi / (2 * (n + 1)));
          CHECK(std::abs(mode->lambda - Complex(0, w) * std::sqrt(Complex(1, eta))) < 1e-9 * w);
        }
      }
}

TEST_CASE("large losses give the modes of complex stiffness")
{
  constexpr int n = 8;
  for (const double eta : {1.0001, 1.3, 5.})
  {
    CAPTURE(eta);
    const Modes modes = modes_of({std::vector<double>(n + 1, eta), 2e4, 0, 20}, 1000);
    CHECK(modes.outcome.residual < 1e-12);
    const auto ordered = by_frequency(modes);
    REQUIRE(ordered.size() == n);
    int j = 0;
    for (const ComplexMode* mode : ordered)
    {
      const double w = 2 * std::sqrt(2e4) * std::sin(++j * std::numbers::pi / (2 * (n + 1)));
      CHECK(std::abs(mode->lambda - Complex(0, w) * std::sqrt(Complex(1, eta))) < 1e-11 * w); // rounding
    }
  }
}

TEST_CASE("beside strong viscous damping modes are those of complex stiffness")
{
  constexpr int n = 8;
  constexpr double eta = 0.2;
  for (const double alpha : {48., 49., 97., 140., 190., 230.}) // critical is 2 w, of the lowest 98.2
  {
    CAPTURE(alpha);
    const Modes modes = modes_of({std::vector<double>(n + 1, eta), 2e4, alpha, 20}, 1000);
    CHECK(modes.outcome.residual < 1e-12);
    int vibrating = 0;
    for (const ComplexMode& mode : modes.modes)
    {
      if (mode.lambda.imag() == 0) continue; // without frequency
      ++vibrating;
      // w^2 (1 + i eta) + alpha lambda + lambda^2 = 0 for one w^2 of the row
      const Complex square = -mode.lambda * (mode.lambda + alpha) / Complex(1, eta);
      double nearest = HUGE_VAL;
      for (int j = 1; j <= n; ++j)
        nearest =
            std::min(nearest, std::abs(square - 8e4 * std::pow(std::sin(j * std::numbers::pi / (2 * (n + 1))), 2)));
      CHECK(nearest < 1e-9 * 8e4);
    }
    CHECK(vibrating >= n - 2);
  }
}

TEST_CASE("parts of different loss factors have the modes of dense algebra")
{
  double most = 0.3;
  SUBCASE("of linings") {}
  SUBCASE("of shims")
  {
    most = 2.5;
  }
  Row row{{}, 1e4, 1.5, 90};
  for (int i = 0; i < 13; ++i) row.loss.push_back(i < 5 ? most : i < 9 ? 0.01 : 0);
  const int n = row.masses();
  const Eigen::MatrixXd K = dense(row, row.shares()), L = dense(row, row.lossy());
  const std::vector<Complex> stiff = dense_pairs(row.alpha * Eigen::MatrixXd::Identity(n, n), K + Complex(0, 1) * L);
  const Modes modes = modes_of(row, 1000);
  REQUIRE(modes.modes.size() == static_cast<std::size_t>(n));
  for (const ComplexMode& mode : modes.modes)
  {
    CHECK(mode.backward_error < 1e-12);
    CHECK(std::abs(mode.lambda - nearest(stiff, mode.lambda)) < 1e-11 * std::abs(mode.lambda)); // rounding
  }
  CHECK(std::is_sorted(modes.modes.begin(), modes.modes.end(),
                       [](const ComplexMode& a, const ComplexMode& b) { return a.lambda.real() > b.lambda.real(); }));
}

// As of a brake's pins: 40 pairs of masses, each held together by a spring of which every third loses, between weak
// springs. Their 40 opposed motions lie within 2 % of sqrt(2 s), nearer than losses of 0.05 move them. As many lambda
// as masses, none of them twice, at each of which the problem is singular to rounding: none is missing.
TEST_CASE("every mode of a cluster that losses mix is found once")
{
  constexpr int pins = 40;
  Row row{{}, 1e4, 0.5, 100};
  for (int i = 0; i <= 2 * pins; ++i)
  {
    const bool holds = i % 2 == 1;
    row.share.push_back(holds ? 1 + 1e-4 * ((7 * i) % 11) : 0.02);
    row.loss.push_back(holds && i % 6 == 1 ? 0.05 : 0);
  }
  const int n = row.masses();
  const Eigen::MatrixXd K = dense(row, row.shares()), L = dense(row, row.lossy());
  const Modes modes = modes_of(row, 1000);
  CHECK(modes.outcome.kind == OutcomeKind::converged);
  REQUIRE(modes.modes.size() == static_cast<std::size_t>(n));
  for (auto mode = modes.modes.begin(); mode != modes.modes.end(); ++mode)
  {
    const Complex lambda = mode->lambda;
    Eigen::MatrixXcd Q = K + Complex(0, 1) * L;
    Q.diagonal().array() += lambda * (lambda + row.alpha);
    const Eigen::VectorXd singular = Eigen::BDCSVD<Eigen::MatrixXcd>(Q).singularValues();
    CHECK(singular.tail<1>()(0) < 1e-12 * singular(0));
    CHECK(std::all_of(modes.modes.begin(), mode,
                      [&](const ComplexMode& other)
                      { return std::abs(other.lambda - lambda) > 1e-8 * std::abs(lambda); }));
  }
}
