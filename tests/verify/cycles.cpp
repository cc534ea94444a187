// ranks: 1
// Limit cycles of the three-degree unilateral oscillator against exact ones (matrix exponentials between events).
#include "../support/approx.hpp"
#include "../support/cycle_of.hpp"
#include "../support/small_models.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;

namespace
{

struct Row
{
  double friction, belt, period, mean_energy, multiplier;
};

// period, mean energy, largest non-trivial multiplier: exact to the digits given
constexpr Row rows[] = {{0.3, 0.3, 5.938028240916, 0.77336848489, 0.9241873},
                        {0.3, 0.6, 5.954461004653, 1.77650678461, 0.71516819},
                        {0.3, 1, 5.984555109780, 2.44704680486, 0.65000242},
                        {0.3, 2, 5.993768001880, 4.62721318386, 0.63739061}};

std::complex<double> nearest(const std::vector<std::complex<double>>& multipliers, double value)
{
  return *std::min_element(multipliers.begin(), multipliers.end(),
                           [=](auto a, auto b) { return std::abs(a - value) < std::abs(b - value); });
}

} // namespace

TEST_CASE("exact limit cycles: stick, lift-off, touch, backward slip")
{
  for (const Row& row : rows)
  {
    CAPTURE(row.belt);
    const LimitCycle cycle = cycle_of(unilateral_oscillator(row.friction, row.belt), 400, 0, 1e-8);
    CHECK(cycle.outcome.kind == OutcomeKind::converged);
    CHECK(cycle.orbit.residual < 1e-8);
    // the theta step is of second order in the period: 400 steps a period leave 1e-5 to 1e-4, whatever the events
    CHECK(cycle.orbit.period == approx(row.period, 1e-4));
    CHECK(cycle.measured.mean_energy == approx(row.mean_energy, 0.01));
    CHECK(cycle.multipliers.stability == Stability::stable);
    // the trivial multiplier comes out between 0.990 and 1.001 here: so good are the others
    CHECK(cycle.multipliers.trivial_error < 0.01);
    CHECK(std::abs(nearest(cycle.multipliers.values, row.multiplier) - row.multiplier) < 0.01);
    CHECK((cycle.measured.open_pairs_max == 1) == (row.belt > 0.3));
    if (row.belt < 2) CHECK(cycle.measured.stick_pairs_max == 1);
  }
}

TEST_CASE("the paper's base is rank-deficient here, and the reduced system is solved all the same")
{
  CycleOptions options;
  options.shooting.finish = Finish::none;
  options.shooting.subspace_newtons = 10;
  const LimitCycle cycle = cycle_of(unilateral_oscillator(0.3, 1), 400, 0, 1e-8, options);
  CHECK(cycle.outcome.kind == OutcomeKind::converged); // the contact space has two dimensions, and the base spans it
  CHECK(cycle.convergence.records.front().unknowns == 5);
  CHECK(cycle.orbit.period == approx(5.984555109780, 1e-4));
}
