// ranks: 1 2
// Modes of matrices alone, (lambda^2 M + lambda (C + G) + K + H) phi = 0, on a chain of n cells of two motions with
//     M = 1,  C = c,  K = s (2 - 2 cos) + (k1, k2),  G = g J,  H = h J,  J = [0 1; -1 0] in each cell.
// Each wave of the chain, kappa_j = s (2 - 2 cos(j pi/(n + 1))), leaves two motions, exactly:
//     (lambda^2 + c lambda + kappa + k1) (lambda^2 + c lambda + kappa + k2) + (g lambda + h)^2 = 0.
#include "../support/linearised.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/solid/structure.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <Eigen/Eigenvalues>
#include <numbers>

using namespace squeal;
using Complex = std::complex<double>;

namespace
{

struct Chain
{
  int cells = 1;
  double s = 1, k1 = 20, k2 = 21, c = 0, g = 0, h = 0;
};

/// The polynomial of a wave, highest power first.
std::array<double, 5> polynomial(const Chain& chain, double kappa)
{
  const double a = kappa + chain.k1, b = kappa + chain.k2, c = chain.c, g = chain.g, h = chain.h;
  return {1, 2 * c, c * c + a + b + g * g, c * (a + b) + 2 * g * h, a * b + h * h};
}

/// Its roots with Im > 0, each by Newton from those of a companion matrix.
std::vector<Complex> roots(const std::array<double, 5>& p)
{
  Eigen::Matrix4d companion = Eigen::Matrix4d::Zero();
  for (int i = 0; i < 4; ++i) companion(0, i) = -p[static_cast<std::size_t>(i) + 1];
  for (int i = 1; i < 4; ++i) companion(i, i - 1) = 1;
  std::vector<Complex> result;
  for (Complex root : Eigen::EigenSolver<Eigen::Matrix4d>(companion).eigenvalues())
  {
    for (int i = 0; i < 3; ++i)
    {
      const Complex value = (((p[0] * root + p[1]) * root + p[2]) * root + p[3]) * root + p[4];
      root -= value / (((4 * p[0] * root + 3 * p[1]) * root + 2 * p[2]) * root + p[3]);
    }
    if (root.imag() > 0) result.push_back(root);
  }
  return result;
}

std::vector<Complex> exact_pairs(const Chain& chain, double band)
{
  std::vector<Complex> result;
  for (int j = 1; j <= chain.cells; ++j)
    for (const Complex root :
         roots(polynomial(chain, chain.s * (2 - 2 * std::cos(j * std::numbers::pi / (chain.cells + 1))))))
      if (std::abs(root) < two_pi * band) result.push_back(root);
  return result;
}

/// Each cell's block [a, b; d, a + e] and its neighbours' `coupling`, on the pattern of all of them.
Owned<Mat> chain_matrix(const Chain& chain, const std::array<double, 4>& block, double coupling)
{
  Owned<Mat> A;
  check(MatCreateAIJ(PETSC_COMM_WORLD, PETSC_DECIDE, PETSC_DECIDE, 2 * chain.cells, 2 * chain.cells, 4, nullptr, 4,
                     nullptr, A.put()));
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(A, &first, &last));
  for (PetscInt row = first; row < last; ++row)
  {
    const PetscInt begin = row - row % 2;
    for (PetscInt k = 0; k < 2; ++k)
      check(MatSetValue(A, row, begin + k, block[static_cast<std::size_t>(2 * (row % 2) + k)], INSERT_VALUES));
    for (const PetscInt other : {row - 2, row + 2})
      if (other >= 0 && other < 2 * chain.cells) check(MatSetValue(A, row, other, coupling, INSERT_VALUES));
  }
  check(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  return A;
}

test::SmallModel model_of(const Chain& chain)
{
  test::SmallModel model;
  Structure& structure = model.structure;
  const double own = 2 * chain.s;
  structure.M = chain_matrix(chain, {1, 0, 0, 1}, 0);
  structure.C = chain_matrix(chain, {chain.c, 0, 0, chain.c}, 0);
  structure.K = chain_matrix(chain, {own + chain.k1, 0, 0, own + chain.k2}, -chain.s);
  for (const Mat A : {structure.M.get(), structure.C.get(), structure.K.get()})
    check(MatSetOption(A, MAT_SYMMETRIC, PETSC_TRUE));
  if (chain.g != 0) structure.G = chain_matrix(chain, {0, chain.g, -chain.g, 0}, 0);
  if (chain.h != 0) structure.H = chain_matrix(chain, {0, chain.h, -chain.h, 0}, 0);
  check(MatCreateVecs(structure.K, structure.load.put(), nullptr));
  PetscInt local = 0;
  check(MatGetLocalSize(structure.K, &local, nullptr));
  model.interface.B = matrix_of_rows({}, local, PETSC_COMM_WORLD);
  return model;
}

Modes modes_of(const Chain& chain, double band)
{
  const test::SmallModel model = model_of(chain);
  const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
  ModesSettings settings;
  settings.band = band;
  return test::modes_of(model, equilibrium, settings, {});
}

/// Every exact pair is found once, and nothing else.
void compare(const Modes& modes, std::vector<Complex> exact, double tolerance, double backward)
{
  CHECK(modes.outcome.kind == OutcomeKind::converged);
  REQUIRE(modes.modes.size() == exact.size());
  double worst = 0, error = 0;
  for (const ComplexMode& mode : modes.modes)
  {
    const auto nearest =
        std::min_element(exact.begin(), exact.end(),
                         [&](Complex a, Complex b) { return std::abs(a - mode.lambda) < std::abs(b - mode.lambda); });
    worst = std::max(worst, std::abs(*nearest - mode.lambda) / std::abs(*nearest));
    exact.erase(nearest);
    error = std::max(error, mode.backward_error);
  }
  CHECK(worst < tolerance);
  CHECK(error < backward);
}

int unstable_in(const std::vector<Complex>& pairs)
{
  return static_cast<int>(std::count_if(pairs.begin(), pairs.end(), is_unstable));
}

} // namespace

TEST_CASE("flutter pairs of two and four degrees of freedom are exact")
{
  for (const int cells : {1, 2})
    for (const double h : {0.3, 0.6, 5.})
      for (const double g : {0., 0.4, -3.})
      {
        CAPTURE(h);
        CAPTURE(g);
        const Chain chain{cells, 3, 20, 21, 0.1, g, h};
        const std::vector<Complex> exact = exact_pairs(chain, 10);
        const Modes modes = modes_of(chain, 10);
        compare(modes, exact, 1e-12, 1e-14); // rounding: no two roots are nearer than 0.1
        CHECK(modes.unstable_count == unstable_in(exact));
        CHECK(modes.count.certified_by == Certificate::all_pairs);
      }
  // without gyroscopic part flutter begins at h = (k2 - k1)/2, less what the damping takes
  CHECK(modes_of({1, 3, 20, 21, 0, 0, 0.49}, 10).unstable_count == 0);
  CHECK(modes_of({1, 3, 20, 21, 0, 0, 0.51}, 10).unstable_count == 1);
}

TEST_CASE("of 5000 degrees of freedom all pairs of the band are found, with backward errors below 1e-12")
{
  for (const auto& [g, h] : {std::pair{0., 2.}, std::pair{0.5, 2.}, std::pair{1., 0.}})
  {
    CAPTURE(g);
    CAPTURE(h);
    const Chain chain{2500, 1e6, 20, 21, 0.15, g, h};
    const std::vector<Complex> exact = exact_pairs(chain, 10);
    REQUIRE(exact.size() > 90);
    const Modes modes = modes_of(chain, 10);
    compare(modes, exact, 1e-8, 1e-12); // rounding of a stiffness of 4e6 beside 20: 5e-11, with a sum of 2500 entries
    CHECK(modes.unstable_count == unstable_in(exact));
    CHECK(modes.count.certified_by == Certificate::none);
    CHECK(modes.count_check.find("cannot count what gyroscopic") != std::string::npos);
  }
}
