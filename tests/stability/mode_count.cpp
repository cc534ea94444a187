// Where eigenvalues crowd: a chain of cells of two modes each that friction couples (M = I, C = .02 I), 100 pairs
// within 1 % to 30 % of each other, many of them close to coalescence, where a pair moves like the square root of a
// change.
#include "../support/small_models.hpp"
#include "squeal/analysis/projection.hpp"
#include "squeal/analysis/shift_invert.hpp"
#include "squeal/analysis/slices.hpp"

#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;

namespace
{

constexpr double band = 10; // [Hz], all of the chain

Owned<Mat> stiffness(int cells, double mu)
{
  const double k = 4.5 * std::sqrt(3.) / 2;
  const auto n = 2 * static_cast<std::size_t>(cells);
  Rows K = zeros(n, n), pattern = zeros(n, n);
  for (std::size_t i = 0; i < n; i += 2)
  {
    K[i][i] = 2 + 17;
    K[i][i + 1] = k - 11 * mu;
    K[i + 1][i] = k;
    K[i + 1][i + 1] = 18.75;
    if (i + 2 < n) K[i][i + 2] = K[i + 2][i] = -1;
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) pattern[i][j] = K[i][j] != 0 || i == j;
  return sparse(K, pattern);
}

Owned<Mat> unit(int cells, double factor)
{
  const Rows D = diagonal(std::vector<double>(2 * static_cast<std::size_t>(cells), factor));
  return sparse(D, diagonal(std::vector<double>(2 * static_cast<std::size_t>(cells), 1.)));
}

int unstable(const QuadraticSolution& solution)
{
  int count = 0;
  for (const Eigenpair& pair : solution.pairs) count += is_unstable(pair.lambda);
  return count;
}

} // namespace

// The counts 44 and 17 and the rightmost pair are exact; 1e-11 is what 1e-13 of backward error leaves of it.
TEST_CASE("slices miss none of a hundred crowded pairs, and the frictionless structure counts them")
{
  const int cells = 50;
  const Owned<Mat> M = unit(cells, 1), frictionless = stiffness(cells, 0);
  const RealModes real = solve_real_modes_below(M, frictionless, band, 0);
  REQUIRE(real.outcome.word == "converged");
  REQUIRE(real.omega.size() == 100);
  for (const auto& [mu, flutter] : {std::pair{.38, 44}, std::pair{.36, 17}, std::pair{0., 0}})
  {
    CAPTURE(mu);
    const QuadraticProblem problem{unit(cells, 1), unit(cells, .02), stiffness(cells, mu)};
    const CountedSolution sliced = solve_by_slices(problem, real.omega, band, 1.05 * band);
    CHECK(sliced.count.expected == 100);
    CHECK(sliced.count.found == 100);
    CHECK(unstable(sliced.solution) == flutter);
    CHECK(sliced.solution.outcome.residual < 1e-12);
    if (mu == .38)
      CHECK(std::abs(sliced.solution.pairs[0].lambda - std::complex<double>(.111240406422, 4.328534114602)) < 1e-10);
  }
}

// Ten bodies that do not touch: every frequency is tenfold, and a space grown from one vector holds one of each.
TEST_CASE("real modes of ten equal bodies are all found, though every frequency is tenfold")
{
  constexpr std::size_t bodies = 10, masses = 6;
  Rows K = zeros(bodies * masses, bodies * masses), pattern = K;
  for (std::size_t i = 0; i < K.size(); ++i)
  {
    K[i][i] = 2;
    pattern[i][i] = 1;
    if (i % masses > 0) K[i][i - 1] = K[i - 1][i] = -1;
    if (i % masses > 0) pattern[i][i - 1] = pattern[i - 1][i] = 1;
  }
  const Owned<Mat> M = unit(bodies * masses / 2, 1), stiff = sparse(K, pattern);
  const RealModes modes = solve_real_modes(M, stiff, 35, 0);
  REQUIRE(modes.outcome.word == "converged");
  REQUIRE(modes.omega.size() == 35);
  for (std::size_t k = 0; k < 35; ++k) // omega_j = 2 sin(j pi / 2 (masses + 1))
    CHECK(
        modes.omega[k] ==
        doctest::Approx(2 * std::sin(static_cast<double>(k / bodies + 1) * M_PI / (2 * (masses + 1)))).epsilon(1e-10));
}

// A basis of few real modes loses the coupling, and with it the flutter: silently, but for the backward error.
TEST_CASE("the projection misses unstable pairs with too few real modes, and its backward errors say so")
{
  const int cells = 50;
  const Owned<Mat> M = unit(cells, 1), frictionless = stiffness(cells, 0);
  const QuadraticProblem problem{unit(cells, 1), unit(cells, .02), stiffness(cells, .38)};
  const auto projected = [&](int modes, int passes) {
    return solve_projected(problem, M, frictionless, solve_real_modes(M, frictionless, modes, 0), {band, passes, 100});
  };
  const QuadraticSolution few = projected(40, 0), all = projected(100, 0);
  CHECK(unstable(few) == 0); // lower branch alone: nothing to couple with
  CHECK(few.outcome.residual > 1e-3);
  CHECK(unstable(all) == 44);
  CHECK(all.outcome.residual < 1e-13);
  const QuadraticSolution corrected = projected(40, 3);
  CHECK(unstable(corrected) > unstable(few));
}

// MUMPS estimates its memory before it meets the pivots that rounding makes it put off; at -90 % of that it is always
// short, and the solve of a factor that never came to be would fail. X = A^-1 (A X) to 1e-12: cond(A) is below 1e3.
TEST_CASE("a factor that runs short of its estimated memory is made again with more")
{
  const int cells = 400;
  const Owned<Mat> K = stiffness(cells, .38), M = unit(cells, 1);
  check(PetscOptionsSetValue(nullptr, "-modes_mat_mumps_icntl_14", "-90"));
  for (const Symmetry symmetry : {Symmetry::general, Symmetry::symmetric})
  {
    const bool general = symmetry == Symmetry::general;
    const Owned<Mat> A = general ? stiffness(cells, .38) : stiffness(cells, 0);
    ShiftInvert pencil = make_shift_invert(A, M, symmetry);
    for (const double shift : {-1., 12.})
    {
      move_to(pencil, shift);
      CHECK(pencil.shift == shift);
      Block X = empty_block(A);
      append(X, vector_like(A, std::vector<double>(2 * cells, 1.)));
      Block Y = solved(pencil.factor, product(pencil.shifted, X));
      add_combination(Y, -1, X, {1});
      CHECK(column_norms(Y)[0] < 1e-12 * column_norms(X)[0]);
    }
  }
  check(PetscOptionsClearValue(nullptr, "-modes_mat_mumps_icntl_14"));
}

// Diagonal, K = 1, 2, …, so that K - 3 M has a pivot that is exactly zero: the shift moves below it, 1e-6 of it.
TEST_CASE("a shift that is an eigenvalue moves just below it, and the counts are those below it")
{
  std::vector<double> values, ones(40, 1.);
  for (int i = 1; i <= 40; ++i) values.push_back(i);
  const Owned<Mat> K = sparse(diagonal(values), diagonal(ones)), M = sparse(diagonal(ones), diagonal(ones));
  for (const Symmetry symmetry : {Symmetry::general, Symmetry::symmetric})
  {
    ShiftInvert pencil = make_shift_invert(K, M, symmetry);
    move_to(pencil, 3);
    CHECK(pencil.shift < 3);
    CHECK(pencil.shift > 2.9999);
    if (symmetry == Symmetry::symmetric) CHECK(negative_pivots(pencil) == 2);
  }
  const double edge = std::sqrt(3.) / (2 * M_PI), omega = 2 * M_PI * edge; // rounding decides if 3 lies below
  const RealModes modes = solve_real_modes_below(M, K, edge, 0);
  CHECK(modes.outcome.word == "converged");
  CHECK(modes.omega.size() == (3 < omega * omega ? 3u : 2u));
}
