// Published and exact eigenvalues of sliding systems.
#include "../support/flutter_chain.hpp"
#include "../support/linearised.hpp"
#include "../support/sliding_oscillator.hpp"
#include "squeal/modes/modes.hpp"
#include "squeal/modes/passes.hpp"

#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;
using Complex = std::complex<double>;

namespace
{

QuadraticSolution by_lapack(const QuadraticProblem& problem)
{
  return solve_whole(problem, nullptr, {vibration_floor(norms_of(problem)), 400 * M_PI * M_PI}); // below 10 Hz
}

QuadraticSolution by_arnoldi(const QuadraticProblem& problem)
{
  return solve_quadratic(problem, {10, 0, 5});
}

// Two modes coupled by friction (Hoffmann et al. 2002).
int unstable_modes_of_two(double mu, double c1, double c2)
{
  const double k = 3.897114317029974;
  const QuadraticProblem problem = problem_of(diagonal({1, 1}), diagonal({c1, c2}), {{23.25, k - 11 * mu}, {k, 18.75}});
  return count_unstable(by_lapack(problem));
}

// M = [3 1; 1 1], follower force P, damping b
int unstable_modes_of_ziegler(double P, double b)
{
  const QuadraticProblem problem = problem_of({{3, 1}, {1, 1}}, {{2 * b, -b}, {-b, b}}, {{2 - P, P - 1}, {-1, 1}});
  return count_unstable(by_lapack(problem));
}

double distance(const QuadraticSolution& solution, Complex lambda)
{
  double nearest = INFINITY;
  for (const Eigenpair& pair : solution.pairs) nearest = std::min(nearest, std::abs(pair.lambda - lambda));
  return nearest;
}

} // namespace

// At the threshold the undamped pair is defective. It leaves the axis like the square root of the distance, so 1e-9 of
// distance shows as 1e-5 of growth. A bracket is the sharpest test.
TEST_CASE("two coupled modes flutter from the exact friction coefficient on, with and without damping")
{
  const struct
  {
    double mu, c1, c2;
  } thresholds[] = {{0.472377492973330, 0, 0},
                    {0.395110300148, 0.2, 0.02},
                    {0.395453847416, 0.02, 0.2},
                    {0.473602175363, 0.05, 0.05}};
  for (const auto& [mu, c1, c2] : thresholds)
  {
    CAPTURE(mu);
    // Undamped below the threshold, rounding of the nearly double pair is of order 1e-16/1e-5.
    const double margin = c1 == 0 ? 1e-9 : 1e-6;
    CHECK(unstable_modes_of_two(mu - margin, c1, c2) == 0);
    CHECK(unstable_modes_of_two(mu + margin, c1, c2) == 1);
  }
  const QuadraticProblem problem =
      problem_of(diagonal({1, 1}), diagonal({0, 0}), {{23.25, 3.897114317029974 - 5.5}, {3.897114317029974, 18.75}});
  CHECK(distance(by_lapack(problem), {0.118690019, 4.584112490}) < 1e-8); // all the digits that are given
}

TEST_CASE("the Ziegler column loses stability at its exact loads, sooner with vanishing damping")
{
  const double flutter = 3.5 - std::sqrt(2.), damped = 41. / 28 + 0.1 * 0.1 / 2;
  CHECK(unstable_modes_of_ziegler(flutter - 1e-8, 0) == 0);
  CHECK(unstable_modes_of_ziegler(flutter + 1e-8, 0) == 1);
  CHECK(unstable_modes_of_ziegler(damped - 1e-6, 0.1) == 0);
  CHECK(unstable_modes_of_ziegler(damped + 1e-6, 0.1) == 1);
}

TEST_CASE("no unstable mode of a chain of cells is missed, solved whole or by Arnoldi")
{
  for (const auto solve : {by_lapack, by_arnoldi})
  {
    const QuadraticSolution many = solve(flutter_chain(50, 0.38)), fewer = solve(flutter_chain(50, 0.36));
    CHECK(many.outcome.kind == OutcomeKind::converged);
    CHECK(many.pairs.size() == 100);
    CHECK(count_unstable(many) == 44);
    CHECK(count_unstable(fewer) == 17);
    CHECK(std::abs(many.pairs[0].lambda - Complex(0.111240406422, 4.328534114602)) < 1e-11);
    CHECK(many.outcome.residual < 1e-12); // rounding of a companion matrix of order 200
  }
}

TEST_CASE("the wing of the NLEVP collection has its published eigenvalues")
{
  const QuadraticProblem wing = problem_of({{17.6, 1.28, 2.89}, {1.28, 0.824, 0.413}, {2.89, 0.413, 0.725}},
                                           {{7.66, 2.45, 2.1}, {0.23, 1.04, 0.223}, {0.6, 0.756, 0.658}},
                                           {{121, 18.9, 15.9}, {0, 2.7, 0.145}, {11.9, 3.64, 15.5}});
  const QuadraticSolution solution = by_lapack(wing);
  REQUIRE(solution.pairs.size() == 3);
  for (const Complex lambda :
       {Complex(0.09472173, 2.52287659), Complex(-0.88483025, 8.44151216), Complex(-0.91799817, 1.76058420)})
    CHECK(distance(solution, lambda) < 1e-8); // all the digits that are given
}

TEST_CASE("the unilateral oscillator slides into flutter at the exact friction coefficient")
{
  ModesSettings settings;
  settings.band = 1;
  const auto modes_at = [&](double mu)
  {
    const SmallModel oscillator = unilateral_oscillator(mu, 1);
    return test::modes_of(oscillator, sliding_equilibrium(oscillator), settings, {});
  };
  const Modes modes = modes_at(0.3);
  REQUIRE(modes.modes.size() == 2);
  CHECK(std::abs(modes.modes[0].lambda - Complex(0.024503265987, 1.059820289428)) < 1e-12);
  CHECK(modes.unstable_count == 1);
  CHECK(modes.outcome.residual < 1e-14);
  CHECK(modes_at(0.17649336676940 - 1e-8).unstable_count == 0);
  CHECK(modes_at(0.17649336676940 + 1e-7).unstable_count == 1);
}
