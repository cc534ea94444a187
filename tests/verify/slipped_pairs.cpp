// ranks: 1 2 3
// Small motions about contacts that have slipped, and the answer mirrored where the drive is reversed.
#include "../support/linearised.hpp"
#include "squeal/transient/theta_step.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using test::Rows;
using test::SmallModel;

namespace
{

/// The oscillator that squeals (pad x y, disc y) with its x spring on a bracket of three nodes in a row, which friction
/// on the ground holds under preloads of their own: motions pad x y, disc y, nodes x, nodes y.
SmallModel mounted_oscillator(const std::array<double, 3>& preload, double damping)
{
  Rows K = test::zeros(9, 9), C = K;
  const auto add_spring = [](Rows& matrix, std::size_t a, std::size_t b, double k)
  {
    matrix[a][a] += k;
    if (a == b) return;
    matrix[b][b] += k;
    matrix[a][b] -= k;
    matrix[b][a] -= k;
  };
  add_spring(K, 0, 3, 1);
  add_spring(K, 1, 1, .4);
  add_spring(K, 0, 1, .1);
  add_spring(K, 2, 2, 1.2);
  add_spring(K, 3, 4, 4);
  add_spring(K, 4, 5, 4);
  add_spring(K, 5, 5, .05);
  add_spring(C, 0, 3, damping);
  for (const auto& [a, b] : {std::pair{1, 1}, {2, 2}, {3, 4}, {4, 5}})
    add_spring(C, static_cast<std::size_t>(a), static_cast<std::size_t>(b), damping);
  SmallModel model;
  model.structure = test::make_structure(test::diagonal({1, 1, .5, .05, .05, .05, .05, .05, .05}), C, K,
                                         {0, -1, 0, 0, 0, 0, -preload[0], -preload[1], -preload[2]});
  Rows B = test::zeros(8, 9);
  B[0][1] = 1;
  B[0][2] = -1;
  B[1][0] = 1;
  for (std::size_t i = 0; i < 3; ++i) B[2 + 2 * i][6 + i] = B[3 + 2 * i][3 + i] = 1;
  model.interface = test::make_interface(B, 1, {0, 0, 0, 0}, {.6, 0, 0, 0}, .3, model.structure.K);
  model.interface.friction.own = {FrictionLaw{.5}};
  model.interface.friction.number_of_own = {-1, 0, 0, 0};
  return model;
}

/// The joints pressed, then the pad, then the disc turned.
void turn_after_pressing(SmallModel& model)
{
  const auto joints = copy_of(model.structure.load.get());
  check(VecSetValue(joints, 1, 0, INSERT_VALUES));
  check(VecAssemblyBegin(joints));
  check(VecAssemblyEnd(joints));
  model.structure.path.push_back({"joints", copy_of(joints.get()), 0});
  model.structure.path.push_back({"press", copy_of(model.structure.load.get()), 0});
  model.structure.path.push_back({"turn", copy_of(model.structure.load.get()), 1});
}

double largest_growth(const SmallModel& model, const Equilibrium& rest)
{
  ModesSettings settings;
  settings.band = 2 / (2 * M_PI);
  double growth = -1;
  for (const ComplexMode& mode : test::modes_of(model, rest, settings, {}).modes)
    if (mode.lambda.imag() > .5) growth = std::max(growth, mode.lambda.real());
  return growth;
}

/// The growth of a small motion in time, over periods 20 to 35 of about its own.
double growth_in_time(const SmallModel& model, const Equilibrium& rest, double kick)
{
  constexpr int steps = 200;
  const double T = 2 * M_PI / 1.06;
  const ThetaStep step = make_theta_step(model.structure, model.interface, T / steps, 0.5, {});
  State state{copy_of(rest.u.get()), test::vector_like(model.structure.K, {kick, 0, 0, 0, 0, 0, 0, 0, 0}), 0,
              rest.reactions};
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  std::vector<double> amplitude;
  for (int period = 0; period < 35; ++period)
  {
    std::vector<double> x;
    for (int i = 0; i < steps; ++i)
    {
      (void)advance(step, model.structure, model.interface, work, state);
      x.push_back(all_entries(state.u)[0]);
    }
    const auto [low, high] = std::ranges::minmax(x);
    amplitude.push_back(high - low);
  }
  return std::log(amplitude[34] / amplitude[19]) / (15 * T);
}

} // namespace

TEST_CASE("a small motion about a joint that has slipped grows as with the joint stuck, whichever way it is kicked")
{
  SmallModel model = mounted_oscillator({.2, 6, 6}, .06);
  turn_after_pressing(model);
  const Equilibrium rest = find_equilibrium(model.structure, model.interface, {});
  REQUIRE(rest.outcome.kind == OutcomeKind::converged);
  CHECK(rest.history->slip == 1);
  CHECK(rest.history->stick == 2);
  const double stuck = largest_growth(model, rest);
  CHECK(stuck == doctest::Approx(.00148).epsilon(5e-3));
  for (const double kick : {1e-6, -1e-6})
    CHECK(growth_in_time(model, rest, kick) == doctest::Approx(stuck).epsilon(2e-2));
  model.interface.friction.common.slipped_pairs_stick = false;
  CHECK(largest_growth(model, rest) < -.01); // the wrong word: along its last friction it slides one way only
}

TEST_CASE("the other sense of the drive gives the mirrored answer, and the path anew the same one")
{
  // a pad between two brackets: motions pad x, y, disc y, brackets x
  const auto found_with = [](double speed)
  {
    SmallModel model;
    const Rows K = test::diagonal({0, 0, 5e7, 3e7, 3e7});
    model.structure = test::make_structure(test::diagonal({1, 1, 1, 1, 1}), test::zeros(5, 5), K, {0, -1000, 0, 0, 0});
    model.interface = test::make_interface(
        {{0, 1, -1, 0, 0}, {1, 0, 0, 0, 0}, {-1, 0, 0, 1, 0}, {0, 1, 0, 0, 0}, {1, 0, 0, 0, -1}, {0, 1, 0, 0, 0}}, 1,
        {0, 0, 0}, {speed, 0, 0}, 0.4, model.structure.K);
    Equilibria equilibria{EquilibriumOptions{}};
    const Equilibrium first = equilibria.at(model.structure, model.interface),
                      again = equilibria.at(model.structure, model.interface);
    CHECK(first.outcome.kind == OutcomeKind::converged);
    CHECK(first.reactions == again.reactions);
    return first.reactions;
  };
  const std::vector<double> forth = found_with(1), back = found_with(-1);
  CHECK(forth[0] == doctest::Approx(1000 / 1.16).epsilon(1e-9));
  const std::vector<double> mirrored = {back[0], -back[1], back[4], back[5], back[2], back[3]};
  for (std::size_t i = 0; i < forth.size(); ++i) CHECK(std::abs(forth[i] - mirrored[i]) < 1e-9 * 1000);
}
