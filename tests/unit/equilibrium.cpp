// ranks: 1 2 3
#include "squeal/equilibrium/equilibrium.hpp"

#include "../support/small_models.hpp"
#include "squeal/base/petsc.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <numeric>
#include <random>
#include <tuple>

using namespace squeal;

namespace
{

/// A rigid block of width b and weight W. Its unknowns are x, y, theta of a point at the load's height h above the
/// middle of its feet. A spring at that height holds it along the belt's motion; contact alone holds y and theta.
test::SmallModel overturning_block(double friction, double weight)
{
  const double b = 0.2, h = 0.15;
  test::SmallModel model;
  const test::Rows K = test::diagonal({1e6, 0, 0});
  model.structure = test::make_structure(test::diagonal({1, 1, 1}), K, K, {0, -weight, 0});
  model.interface = test::make_interface({{0, 1, b / 2}, {1, 0, h}, {0, 1, -b / 2}, {1, 0, h}}, 1, {0, 0}, {1, 1},
                                         friction, model.structure.K);
  return model;
}

/// A row of pads on springs of their own, joined by weaker ones, above a rigid disc with gaps; two tangential
/// directions. Plenty of them lift off.
test::SmallModel random_pads(std::size_t pairs, double friction, double load)
{
  std::mt19937 random(4);
  const auto draw = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const std::size_t n = 3 * pairs;
  test::Rows K = test::diagonal(std::vector<double>(n, 0.)), B = test::zeros(n, n);
  const auto join = [&](std::size_t i, std::size_t j, double k)
  {
    K[i][i] += k;
    K[j][j] += k;
    K[i][j] -= k;
    K[j][i] -= k;
  };
  std::vector<double> force(n, 0.), gap(pairs), drive(2 * pairs);
  for (std::size_t p = 0; p < pairs; ++p)
  {
    for (std::size_t k = 0; k < 3; ++k)
    {
      K[3 * p + k][3 * p + k] += draw(1e6, 2e6);
      B[3 * p + k][3 * p + k] = 1;
      if (p > 0) join(3 * p + k, 3 * p + k - 3, draw(1e5, 1e6));
    }
    join(3 * p, 3 * p + 1, draw(1e5, 5e5)); // sliding couples into pressure
    force[3 * p] = load * draw(-3, 1);
    gap[p] = p % 3 == 0 ? 0 : load * draw(-2e-7, 3e-7);
    drive[2 * p] = draw(-1, 1);
    drive[2 * p + 1] = draw(0.1, 1);
  }
  test::SmallModel model;
  model.structure = test::make_structure(test::diagonal(std::vector<double>(n, 1.)), K, K, force);
  model.interface = test::make_interface(B, 2, gap, drive, friction, model.structure.K);
  return model;
}

} // namespace

TEST_CASE("an overturning block: the feet share the weight as statics says, and it tips above mu = b/(2h)")
{
  // moments: r_1 - r_2 = 2 mu W h/b
  for (const double weight : {100., 1e8, 1e-4})
    for (const double friction : {0., 0.2, 0.4, 0.6})
    {
      const auto model = overturning_block(friction, weight);
      const auto result = find_equilibrium(model.structure, model.interface, {});
      CHECK(result.outcome.kind == OutcomeKind::converged);
      const double small = (0.5 - friction * 0.75) * weight, large = weight - small;
      const std::vector<double>& r = result.reactions;
      CHECK(std::abs(std::min(r[0], r[2]) - small) < 1e-12 * weight);
      CHECK(std::abs(std::max(r[0], r[2]) - large) < 1e-12 * weight);
      CHECK(r[1] == friction * r[0]);
      CHECK(r[3] == friction * r[2]);
      CHECK(result.force_residual < 1e-12);
      CHECK(result.outcome.residual < 1e-12);
      CHECK(result.closed == std::vector<char>{1, 1});
    }
  for (const double friction : {0.68, 0.7, 1., 5.})
  {
    const auto model = overturning_block(friction, 100);
    const auto result = find_equilibrium(model.structure, model.interface, {});
    CHECK(result.outcome.kind == OutcomeKind::no_equilibrium);
    CHECK_FALSE(result.outcome.reason.empty());
  }
}

TEST_CASE("pads that partly lift off: every law of the equilibrium, at any scale of force")
{
  std::vector<double> reference;
  for (const double load : {1., 1e6, 1e-6})
  {
    const auto model = random_pads(40, 0.3, load);
    const auto result = find_equilibrium(model.structure, model.interface, {});
    CHECK(result.outcome.kind == OutcomeKind::converged);
    CHECK(result.outcome.residual < 1e-12); // rounding, after settling
    CHECK(result.force_residual < 1e-13);
    const auto motion = all_entries(result.u);
    const auto e = drive_directions(model.interface);
    int open = 0;
    for (std::size_t p = 0; p < 40; ++p)
    {
      const double r_n = result.reactions[3 * p], gap = model.interface.gap[p] + motion[3 * p];
      CHECK(r_n >= 0);
      CHECK(gap > -1e-20 * load);
      CHECK(result.gaps[p] >= 0);
      CHECK(std::abs(result.gaps[p] - gap) < 1e-20 * load);
      CHECK((result.closed[p] != 0) == (r_n > 0));
      CHECK((r_n == 0 || std::abs(gap) < 1e-20 * load)); // gaps of open pairs are 1e-7 load
      CHECK(result.reactions[3 * p + 1] == 0.3 * r_n * e[2 * p]);
      CHECK(result.reactions[3 * p + 2] == 0.3 * r_n * e[2 * p + 1]);
      open += result.closed[p] ? 0 : 1;
    }
    CHECK(open > 5);
    CHECK(open < 35);
    auto relative_reactions = result.reactions;
    for (double& value : relative_reactions) value /= load;
    if (reference.empty()) reference = relative_reactions;
    for (std::size_t i = 0; i < reference.size(); ++i) CHECK(std::abs(relative_reactions[i] - reference[i]) < 1e-12);
  }
}

TEST_CASE("one factor serves other friction and any drive, but no other matrices")
{
  auto model = random_pads(40, 0.3, 1);
  Equilibria equilibria({});
  (void)equilibria.at(model.structure, model.interface);
  for (const double turned : {1., -2.})
  {
    auto other = random_pads(40, 0.2, 1); // of the same matrices
    other.structure.K = shared(model.structure.K.get());
    other.interface.B = shared(model.interface.B.get());
    for (double& velocity : other.interface.drive) velocity *= turned;
    const auto afresh = find_equilibrium(other.structure, other.interface, {});
    equilibria.expect({});
    const auto found = equilibria.at(other.structure, other.interface);
    CHECK(equilibria.factors() == 1);
    CHECK(found.closed == afresh.closed);
    double largest = 0;
    for (std::size_t i = 0; i < afresh.reactions.size(); ++i)
      largest = std::max(largest, std::abs(found.reactions[i] - afresh.reactions[i]));
    CHECK(largest < 1e-14); // of forces of size 1: signs alone differ
  }
  std::tie(model.interface.drive[2], model.interface.drive[3]) =
      std::pair(-model.interface.drive[3], model.interface.drive[2]);
  const auto across = equilibria.at(model.structure, model.interface);
  CHECK(equilibria.factors() == 1);
  const auto afresh = find_equilibrium(model.structure, model.interface, {});
  CHECK(across.closed == afresh.closed);
  for (std::size_t i = 0; i < afresh.reactions.size(); ++i)
    CHECK(std::abs(across.reactions[i] - afresh.reactions[i]) < 1e-14);
  model.structure.K = copy_of(model.structure.K);
  (void)equilibria.at(model.structure, model.interface);
  CHECK(equilibria.factors() == 2);
}

TEST_CASE("the oscillator at rest: closed, with the reaction of both springs")
{
  // y: 1.7 y - 0.1 x = -1 and x: 1.1 x - 0.1 y = mu r, r = -1.2 y
  const double mu = 0.3, y = -1 / (1.7 - 0.1 * (0.1 - 1.2 * mu) / 1.1), r = -1.2 * y;
  const auto model = test::unilateral_oscillator(mu, 0.6);
  const auto result = find_equilibrium(model.structure, model.interface, {});
  CHECK(result.outcome.kind == OutcomeKind::converged);
  CHECK(std::abs(result.reactions[0] - r) < 1e-14);
  CHECK(std::abs(result.reactions[1] - mu * r) < 1e-14);
  CHECK(std::abs(all_entries(result.u)[1] - y) < 1e-14);
}

TEST_CASE("a chain that stands on the ground alone carries its weight; lifted, it has no equilibrium")
{
  const auto standing = test::mass_spring_chain(9, 2, 1e9, 1e-3, -9.81);
  const auto result = find_equilibrium(standing.structure, standing.interface, {});
  CHECK(result.outcome.kind == OutcomeKind::converged);
  CHECK(std::abs(result.reactions[0] - 16 * 9.81) < 1e-9); // 8 masses in all; mass times 1e-12
  CHECK(std::abs(all_entries(result.u)[0] + 1e-3) < 1e-15);
  const auto lifted = test::mass_spring_chain(9, 2, 1e9, 1e-3, 9.81);
  CHECK(find_equilibrium(lifted.structure, lifted.interface, {}).outcome.kind == OutcomeKind::no_equilibrium);
}

TEST_CASE("far from contact nothing is closed, and a body that nothing can hold is named")
{
  const test::Rows K = {{3, -1, 0}, {-1, 2, 0}, {0, 0, 0}}, held = {{3, -1, 0}, {-1, 2, 0}, {0, 0, 1}};
  const test::Rows B = {{1, 0, 0}, {0, 1, 0}};
  const auto open = test::make_structure(held, held, held, {-1, -2, 0});
  const auto result = find_equilibrium(open, test::make_interface(B, 1, {5}, {1}, 0.3, open.K), {});
  CHECK(result.outcome.kind == OutcomeKind::converged);
  CHECK(result.closed == std::vector<char>{0});
  CHECK(result.outcome.residual == 0);
  const auto loose = test::make_structure(held, held, K, {-1, -2, 0});
  const auto interface = test::make_interface(B, 1, {0}, {1}, 0.3, loose.K);
  CHECK_THROWS_WITH_AS(find_equilibrium(loose, interface, {}), doctest::Contains("dof 2"), Error);
}
