// Multipliers by oblique projection against the whole monodromy matrix, on random frictional oscillators.
// ranks: 1 2
#include "../support/cycle_of.hpp"
#include "squeal/algebra/dense_matrix.hpp"

#include <algorithm>
#include <doctest/doctest.h>
#include <numeric>
#include <random>

using namespace squeal;
using namespace squeal::test;

namespace
{

/// The unilateral oscillator with random springs, friction and belt, and masses that hang on its pad.
SmallModel random_oscillator(std::mt19937& random, std::size_t more)
{
  const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
  const std::size_t n = 3 + more;
  Rows K = zeros(n, n), C = zeros(n, n);
  std::vector<double> masses(n, 1), load(n, 0);
  const double across = between(0.08, 0.12);
  K[0][0] = between(0.95, 1.05) + across;
  K[1][1] = between(0.38, 0.42) + across;
  K[0][1] = K[1][0] = -across;
  K[2][2] = between(1.1, 1.3);
  masses[2] = 0.5;
  load[1] = -1;
  for (std::size_t i = 0; i < 3; ++i) C[i][i] = between(0.01, 0.02);
  for (std::size_t i = 3; i < n; ++i)
  {
    const std::size_t on = i % 2; // the direction of the pad that it moves in
    masses[i] = between(0.02, 0.1);
    const double stiffness = masses[i] * between(2, 4), damping = masses[i] * between(0.005, 0.05);
    for (const auto& [matrix, value] : {std::pair{&K, stiffness}, std::pair{&C, damping}})
    {
      (*matrix)[i][i] += value;
      (*matrix)[on][on] += value;
      (*matrix)[i][on] -= value;
      (*matrix)[on][i] -= value;
    }
  }
  Rows B = zeros(2, n);
  B[0][1] = B[1][0] = 1;
  B[0][2] = -1;
  SmallModel model;
  model.structure = make_structure(diagonal(masses), C, K, load);
  model.interface = make_interface(B, 1, {0}, {between(0.5, 1)}, between(0.25, 0.35), model.structure.K);
  return model;
}

LimitCycle examined(const SmallModel& model, MultiplierMethod method)
{
  CycleOptions options;
  options.shooting.multiplier_method = method;
  return cycle_of(model, 100, 10, 1e-10, options);
}

} // namespace

TEST_CASE("the oblique projection's verdict and bars hold against the whole monodromy matrix")
{
  std::mt19937 random(5);
  int compared = 0, decided = 0, projected = 0;
  for (std::size_t sample = 0; sample < 8; ++sample)
  {
    CAPTURE(sample);
    const SmallModel model = random_oscillator(random, sample % 6);
    const LimitCycle whole = examined(model, MultiplierMethod::whole);
    const LimitCycle oblique = examined(model, MultiplierMethod::oblique);
    if (whole.outcome.kind != OutcomeKind::converged) continue;
    REQUIRE(!oblique.multipliers.values.empty());
    const double truth = std::abs(whole.multipliers.values.front()),
                 found = std::abs(oblique.multipliers.values.front());
    CHECK(std::abs(found - truth) <= oblique.multipliers.errors.front());
    // the stage's own agreement is far better than its bars, which hold the grid of time: the model keeps all motions.
    // A whole matrix has the mean of eight points of each step, with half of what one differs by as its bar
    CHECK(std::abs(found - truth) < 1e-6 + 2 * whole.multipliers.errors.front());
    CHECK((oblique.multipliers.stability == Stability::stable) <= (truth < 1));
    CHECK((oblique.multipliers.stability == Stability::unstable) <= (truth > 1));
    ++compared;
    projected += oblique.multipliers.method == MultiplierMethod::oblique;
    decided += oblique.multipliers.stability != Stability::undecided;
  }
  CHECK(compared >= 3);
  CHECK(projected >= compared - 1); // nearly equal multipliers may leave no left vectors that fit
  CHECK(decided >= compared - 1);
}

TEST_CASE("a motion beside a cycle grows or decays as the largest multiplier says")
{
  std::mt19937 random(11);
  int watched = 0, smaller = 0;
  for (std::size_t sample = 0; sample < 6; ++sample)
  {
    CAPTURE(sample);
    CycleOptions options;
    options.shooting.watched_periods = 200;
    const SmallModel model = random_oscillator(random, sample);
    check(MatScale(model.structure.C, 0.15)); // so that small motions take tens of periods to decay
    const LimitCycle cycle = cycle_of(model, 100, 10, 1e-10, options);
    if (cycle.outcome.kind != OutcomeKind::converged) continue;
    if (cycle.multipliers.seen.empty()) continue; // it vanished too soon for a line
    const SeenGrowth& seen = cycle.multipliers.seen.back();
    const double truth = std::abs(cycle.multipliers.values.front());
    // the motion is on one grid, whose multiplier differs from the mean of eight by two bars
    CHECK(std::abs(seen.growth - truth) <= seen.error + 2 * cycle.multipliers.errors.front());
    CHECK(seen.error < 0.01); // or the bar would say nothing
    CHECK(seen.part == doctest::Approx(0.03 * std::pow(0.1, cycle.multipliers.seen.size() - 1)).epsilon(1e-12));
    smaller += cycle.multipliers.seen.size() > 1;
    ++watched;
  }
  CHECK(watched >= 3);
}

TEST_CASE("growth that is seen decides what the largest bar leaves open, and denies \"stable\"")
{
  const auto decided = [](Stability stability, double bar, double growth)
  {
    Multipliers multipliers;
    multipliers.values = {0.99, 0.5};
    multipliers.errors = {bar, 1e-3};
    multipliers.stability = stability;
    decide_by_growth({{60, growth, 0.02, 0.03}}, multipliers);
    return multipliers.stability;
  };
  CHECK(decided(Stability::stable, 1e-4, 1.01) == Stability::stable); // within the error of what was seen
  CHECK(decided(Stability::stable, 1e-4, 1.05) == Stability::undecided);
  CHECK(decided(Stability::undecided, 0.05, 1.05) == Stability::unstable);
  CHECK(decided(Stability::undecided, 0.05, 0.9) == Stability::stable);
  CHECK(decided(Stability::undecided, 0.05, 1.01) == Stability::undecided);
}

TEST_CASE("a state of the cycle is a start from which its own period is found at once")
{
  std::mt19937 random(5);
  const SmallModel model = random_oscillator(random, 0);
  const LimitCycle cycle = cycle_of(model, 100, 10, 1e-10);
  REQUIRE(cycle.outcome.kind == OutcomeKind::converged);
  const State given{copy_of(displacement(cycle.orbit.state)), copy_of(velocity(cycle.orbit.state)), 0, {}};
  CycleSettings settings;
  settings.start.kind = CycleStartKind::file;
  settings.free_periods = 0;
  settings.steps_per_period = 100;
  settings.tolerance = 1e-8;
  CycleOptions unwatched;
  unwatched.shooting.watched_periods = 0; // of a verdict
  const LimitCycle again = cycle_of(model, settings, unwatched, &given);
  CHECK(again.outcome.kind == OutcomeKind::converged);
  // at most three corrections of the mode's period, Newton's steps for the rest, and the test of the half period
  CHECK(again.convergence.periods <= 8);
  CHECK(again.orbit.period == doctest::Approx(cycle.orbit.period).epsilon(1e-6));
}

TEST_CASE("values that an earlier reference needs less go to the later one")
{
  // the reduced multipliers of a squealing pin on two grids of time: the first reference is nearest to the complex pair
  const std::vector<std::complex<double>> references{0.9479, 0.8885, {0.8864, 0.0243}, {0.8864, -0.0243}};
  const std::vector<std::complex<double>> values{{0.8913, 0.0132}, {0.8913, -0.0132}, 1.0155, 0.7374};
  CHECK(nearest_places(references, values) == std::vector<std::size_t>{2, 3, 0, 1});
}

TEST_CASE("values moved by less than half their distances go to their references in any order")
{
  std::mt19937 random(3);
  std::vector<std::complex<double>> references;
  for (int i = 0; i < 40; ++i) references.emplace_back(i % 8, i / 8);
  std::vector<std::size_t> order(references.size());
  std::iota(order.begin(), order.end(), 0U);
  std::uniform_real_distribution<double> part(-0.3, 0.3);
  for (int trial = 0; trial < 20; ++trial)
  {
    std::shuffle(order.begin(), order.end(), random);
    std::vector<std::complex<double>> values(references.size());
    for (std::size_t i = 0; i < order.size(); ++i)
      values[order[i]] = references[i] + std::complex<double>(part(random), part(random));
    CHECK(nearest_places(references, values) == order);
  }
}
