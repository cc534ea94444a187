// What shooting must do on the three-degree unilateral oscillator, on any number of ranks.
#include "../support/approx.hpp"
#include "../support/cycle_of.hpp"
#include "../support/pressed_masses.hpp"
#include "../support/small_models.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <doctest/doctest.h>
#include <span>

using namespace squeal;
using namespace squeal::test;

TEST_CASE("doubling load and drive doubles the cycle and keeps its period")
{
  const SmallModel once = unilateral_oscillator(0.3, 1);
  SmallModel twice = unilateral_oscillator(0.3, 2);
  check(VecScale(twice.structure.load, 2));
  const LimitCycle a = cycle_of(once, 100, 5, 1e-11);
  REQUIRE(a.outcome.kind == OutcomeKind::converged);
  // The doubled state must return after the same period. A cycle found anew would do for its period only: a discrete
  // orbit depends a little on where between the events its steps fall.
  const Owned<Vec> start = copy_of(a.orbit.state.get()), end = zeros_like(start);
  check(VecScale(displacement(start), 2));
  check(VecScale(velocity(start), 2));
  const Equilibrium equilibrium = find_equilibrium(twice.structure, twice.interface, {});
  PeriodMap map{{twice.structure, twice.interface, equilibrium}, {}, 100, 0.5};
  const Flow flow = flow_of(map);
  flow.integrate(a.orbit.period, start, end, nullptr);
  check(VecAXPY(end, -1, start));
  CHECK(energy_norm(flow, end) < 1e-10 * energy_norm(flow, start));
  const LimitCycle b = cycle_of(twice, 100, 5, 1e-11);
  REQUIRE(b.outcome.kind == OutcomeKind::converged);
  CHECK(b.orbit.period == approx(a.orbit.period, 1e-6));
  CHECK(b.measured.mean_energy == approx(4 * a.measured.mean_energy, 1e-6));
}

TEST_CASE("without instability the oscillator falls back to rest: collapsed, not converged")
{
  // mu_c = 0.1765: at 0.1 every motion decays
  const LimitCycle cycle = cycle_of(unilateral_oscillator(0.1, 1), 100, 5, 1e-8);
  CHECK(cycle.outcome.kind == OutcomeKind::collapsed_to_equilibrium);
}

TEST_CASE("a kept step reaches a period nearby within some percent of what the last one moved")
{
  const SmallModel model = unilateral_oscillator(0.3, 1);
  const LimitCycle cycle = cycle_of(model, 200, 5, 1e-11);
  REQUIRE(cycle.outcome.kind == OutcomeKind::converged);
  const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
  PeriodMap kept{{model.structure, model.interface, equilibrium}, {}, 200, 0.5},
      exact{{model.structure, model.interface, equilibrium}, {}, 200, 0.5};
  kept.keeps_step = true;
  const double period = cycle.orbit.period, first = 1.01 * period; // moves the state by some percent
  const Owned<Vec> end = zeros_like(cycle.orbit.state), rate = zeros_like(end), reached = zeros_like(end);
  int steps_kept = 0;
  for (const double change : {1e-5, 1e-4, 1e-3, 1e-2, 1e-1})
  {
    flow_of(kept).integrate(first, cycle.orbit.state, end, rate);
    const KeptStep before = kept.kept;
    CHECK(before.h == first / 200);
    flow_of(kept).integrate(first * (1 + change), cycle.orbit.state, reached, rate);
    flow_of(exact).integrate(first * (1 + change), cycle.orbit.state, end, rate);
    const bool keeps = kept.kept.h == before.h;
    CHECK(keeps == (kept.kept.h != first * (1 + change) / 200));
    steps_kept += keeps;
    check(VecAXPY(reached, -1, end));
    double error = 0, speed = 0;
    check(VecNorm(velocity(reached), NORM_2, &error));
    check(VecNorm(velocity(end), NORM_2, &speed));
    // twice the 3 %, since the curvature is that of the end; the step's own error moves by 3 change (omega h)^2/12
    CHECK(error <= (0.06 * before.moved + change * 1e-3) * speed);
  }
  CHECK(steps_kept >= 2);
  CHECK(steps_kept < 5);
}
