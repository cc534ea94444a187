// Where eigenvalues crowd, a pair moves like the square root of a change.
#include "../support/flutter_chain.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/modes.hpp"
#include "squeal/modes/real_modes.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;

namespace
{

constexpr double band = 10;                 // [Hz], all of the chain
const ModesOptions large{.dense_limit = 0}; // the methods of large problems

PairSearch pairs_of(const QuadraticProblem& problem, const QuadraticProblem& frictionless, double end,
                    const ModesOptions& options)
{
  return search_pairs({problem, nullptr, frictionless.M, frictionless.K}, ModesMethod::full, end, options);
}

} // namespace

// The counts 44 and 17 and the rightmost pair are exact; 1e-11 is what 1e-13 of backward error leaves of it.
TEST_CASE("slices miss none of a hundred crowded pairs, and the frictionless structure counts them")
{
  const int cells = 50;
  const QuadraticProblem frictionless = flutter_chain(cells, 0);
  const RealModes real = solve_real_modes_below(frictionless.M, frictionless.K, band, large);
  REQUIRE(real.outcome.kind == OutcomeKind::converged);
  REQUIRE(real.omega.size() == 100);
  for (const auto& [mu, flutter] : {std::pair{0.38, 44}, std::pair{0.36, 17}, std::pair{0., 0}})
  {
    CAPTURE(mu);
    const QuadraticProblem problem = flutter_chain(cells, mu);
    const PairSearch sliced = pairs_of(problem, frictionless, band, large);
    const ModeCount count = count_pairs(sliced, 0, 2 * M_PI * band);
    CHECK(count.expected == 100);
    CHECK(count.found == 100);
    CHECK(count_unstable(sliced.solution) == flutter);
    CHECK(sliced.solution.outcome.residual < 1e-12);
    if (mu == 0.38)
      CHECK(std::abs(sliced.solution.pairs[0].lambda - std::complex<double>(0.111240406422, 4.328534114602)) < 1e-10);
  }
}

// Dashpots across every eighth spring of a chain, of 5 N s/m and of 50, which all but lock it: no C = alpha M + beta K
// comes near. All C beside them, 0.06 M, damps by 8 to 14 %. LAPACK solves the chain whole; 1e-9 is what backward
// errors of 1e-12 leave of eigenvalues that are 1e2 times as sensitive.
TEST_CASE("slices find heavily and unevenly damped pairs as LAPACK does, and no others")
{
  constexpr std::size_t masses = 200;
  constexpr double edge = 0.5 / (2 * M_PI); // a quarter of the spectrum
  Rows K = zeros(masses, masses);
  const Rows M = diagonal(std::vector<double>(masses, 1.));
  for (std::size_t i = 0; i < masses; ++i)
  {
    K[i][i] = 2.05;
    if (i > 0) K[i][i - 1] = K[i - 1][i] = -1;
  }
  const QuadraticProblem frictionless = problem_of(M, M, K);
  for (std::size_t i = 0; i + 4 < masses; i += 10) K[i][i + 3] += 0.02;
  for (const double dashpot : {5., 50.})
  {
    CAPTURE(dashpot);
    Rows C = diagonal(std::vector<double>(masses, 0.06));
    for (std::size_t i = 0; i + 1 < masses; i += 8)
    {
      C[i][i] = C[i + 1][i + 1] = 0.06 + dashpot;
      C[i][i + 1] = C[i + 1][i] = -dashpot;
    }
    const QuadraticProblem problem = problem_of(M, C, K);
    const QuadraticSolution sliced = pairs_of(problem, frictionless, edge, large).solution,
                            whole = pairs_of(problem, frictionless, edge, {.dense_limit = 1000}).solution;
    REQUIRE(whole.pairs.size() > 20);
    const auto inside = std::count_if(sliced.pairs.begin(), sliced.pairs.end(),
                                      [](const Eigenpair& pair) { return std::abs(pair.lambda) < 0.5; });
    CHECK(static_cast<std::size_t>(inside) == whole.pairs.size());
    for (const Eigenpair& pair : whole.pairs)
    {
      double nearest = INFINITY;
      for (const Eigenpair& other : sliced.pairs) nearest = std::min(nearest, std::abs(other.lambda - pair.lambda));
      CHECK(nearest < 1e-9 * std::abs(pair.lambda));
      CHECK(pair.lambda.real() < -0.05 * std::abs(pair.lambda));
    }
  }
}

// As of a brake with so many equal pins: more modes than a slice takes lie closer than slices part.
TEST_CASE("slices find a hundred and thirty modes within a millionth of their frequency")
{
  std::vector<double> stiffness;
  for (int i = 0; i < 130; ++i) stiffness.push_back(1 + 1e-8 * i);
  for (int i = 0; i < 70; ++i) stiffness.push_back(2 + 0.1 * i);
  const std::size_t size = stiffness.size();
  const QuadraticProblem problem = problem_of(diagonal(std::vector<double>(size, 1.)),
                                              diagonal(std::vector<double>(size, 0.01)), diagonal(stiffness));
  const PairSearch sliced = pairs_of(problem, problem, 1, large);
  const ModeCount count = count_pairs(sliced, 0, 2 * M_PI);
  CHECK(count.expected == 200);
  CHECK(count.found == 200);
  CHECK(sliced.solution.outcome.residual < 1e-12);
}

// Ten bodies that do not touch: every frequency is tenfold, and a space grown from one vector holds one of each.
TEST_CASE("real modes of ten equal bodies are all found, though every frequency is tenfold")
{
  constexpr std::size_t bodies = 10, masses = 6;
  Rows K = zeros(bodies * masses, bodies * masses);
  for (std::size_t i = 0; i < K.size(); ++i)
  {
    K[i][i] = 2;
    if (i % masses > 0) K[i][i - 1] = K[i - 1][i] = -1;
  }
  const QuadraticProblem problem =
      problem_of(diagonal(std::vector<double>(K.size(), 1.)), zeros(K.size(), K.size()), K);
  const auto exact = [](double j) { return 2 * std::sin(j * M_PI / (2 * (masses + 1))); };
  const RealModes modes = solve_real_modes_below(problem.M, problem.K, exact(3.5) / (2 * M_PI), large);
  REQUIRE(modes.outcome.kind == OutcomeKind::converged);
  REQUIRE(modes.omega.size() == 30);
  for (std::size_t k = 0; k < 30; ++k)
    CHECK(modes.omega[k] == doctest::Approx(exact(static_cast<double>(k / bodies + 1))).epsilon(1e-10));
}

// Ten free chains. Their rigid motions leave K singular, and the limit lies above the second of six tenfold values.
// Shapes are solved to 1e-7, and theta is off by its square; rounding of K is 1e-16.
TEST_CASE("real modes of ten equal free bodies include every rigid motion")
{
  constexpr std::size_t bodies = 10, masses = 6;
  Rows K = zeros(bodies * masses, bodies * masses);
  for (std::size_t i = 0; i + 1 < K.size(); ++i)
    if (i % masses + 1 < masses)
    {
      K[i][i] += 1;
      K[i + 1][i + 1] += 1;
      K[i][i + 1] = K[i + 1][i] = -1;
    }
  const QuadraticProblem problem =
      problem_of(diagonal(std::vector<double>(K.size(), 1.)), zeros(K.size(), K.size()), K);
  const auto exact = [](std::size_t k) { return 2 * std::sin(static_cast<double>(k / bodies) * M_PI / (2 * masses)); };
  const RealModes below = solve_real_modes_below(problem.M, problem.K, (exact(10) + exact(20)) / (4 * M_PI), large);
  CHECK(below.outcome.kind == OutcomeKind::converged);
  CHECK(below.omega.size() == 20);
  const RealModes first = solve_real_modes_below(problem.M, problem.K, (exact(30) + exact(40)) / (4 * M_PI), large);
  CHECK(first.outcome.kind == OutcomeKind::converged);
  REQUIRE(first.omega.size() == 40);
  for (std::size_t k = 0; k < 40; ++k) CHECK(std::abs(std::pow(first.omega[k], 2) - std::pow(exact(k), 2)) < 1e-12);
  for (std::size_t k = 0; k < below.omega.size(); ++k)
    CHECK(std::abs(std::pow(below.omega[k], 2) - std::pow(exact(k), 2)) < 1e-12);
  MultiVector shapes = empty_multivector(problem.K);
  for (const Owned<Vec>& shape : first.shapes) append(shapes, shape);
  CHECK((inner_products(shapes, product(problem.M, shapes)) - Eigen::MatrixXd::Identity(40, 40)).norm() < 1e-8);
}

// MUMPS estimates its memory before it meets the pivots that rounding makes it put off. At -90 % of that it is always
// short, and a solve without a factor would fail. X = A^-1 (A X) to 1e-12: cond(A) is below 1e3.
TEST_CASE("a factor that runs short of its estimated memory is made again with more")
{
  const QuadraticProblem chain = flutter_chain(400, 0);
  ShiftInvert pencil = make_shift_invert(chain.K, chain.M, Keep::factor, {.room = -90});
  for (const double shift : {-1., 12.})
  {
    move_to(pencil, shift);
    CHECK(pencil.shift == shift);
    const MultiVector X = random_multivector(chain.K, 3);
    MultiVector KX = product(chain.K, X);
    KX.entries -= shift * product(chain.M, X).entries;
    MultiVector Y = pencil.factor->solve(KX);
    Y.entries -= X.entries;
    for (Eigen::Index j = 0; j < 3; ++j) CHECK(column_norms(Y)[j] < 1e-12 * column_norms(X)[j]);
  }
}

// Diagonal, K = 1, 2, …, so that K - 3 M has a pivot that is exactly zero: the shift moves below it, 1e-6 of it.
TEST_CASE("a shift that is an eigenvalue moves just below it, and the counts are those below it")
{
  std::vector<double> values;
  for (int i = 1; i <= 40; ++i) values.push_back(i);
  const QuadraticProblem problem = problem_of(diagonal(std::vector<double>(40, 1.)), zeros(40, 40), diagonal(values));
  ShiftInvert pencil = make_shift_invert(problem.K, problem.M, Keep::factor, {});
  move_to(pencil, 3);
  CHECK(pencil.shift < 3);
  CHECK(pencil.shift > 2.9999);
  CHECK(pencil.factor->negative_pivots() == 2);
  const double edge = std::sqrt(3.) / (2 * M_PI), omega = 2 * M_PI * edge; // rounding decides if 3 lies below
  const RealModes modes = solve_real_modes_below(problem.M, problem.K, edge, large);
  CHECK(modes.outcome.kind == OutcomeKind::converged);
  CHECK(modes.omega.size() == (3 < omega * omega ? 3u : 2u));
}
