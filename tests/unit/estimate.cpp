// ranks: 1 2 3
#include "squeal/transient/estimate.hpp"
#include "../support/approx.hpp"
#include "../support/linearised.hpp"
#include "../support/sliding_oscillator.hpp"

#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;

namespace
{

struct Found
{
  Estimate estimate;
  ComplexMode mode;
  Equilibrium equilibrium;
  double per_y = 0; // |phi| of y: the published amplitudes are those of y
};

Found estimate_of(double mu, double belt_speed)
{
  const SmallModel oscillator = unilateral_oscillator(mu, belt_speed);
  Found found;
  found.equilibrium = sliding_equilibrium(oscillator);
  ModesSettings settings;
  settings.band = 1;
  Modes modes = test::modes_of(oscillator, found.equilibrium, settings, {});
  found.mode = std::move(modes.modes.at(0));
  found.per_y = std::hypot(all_entries(found.mode.real)[1], all_entries(found.mode.imaginary)[1]);
  found.estimate = test::estimate_of(oscillator, found.equilibrium, found.mode);
  return found;
}

} // namespace

// Exact: roots of the same balance by SciPy's adaptive quadrature between events. Published: the force jumps where
// sliding reverses, and the published roots are 2e-5 off, as those of an equidistant rule are.
TEST_CASE("the energy balance of the unilateral oscillator has its exact roots")
{
  const struct
  {
    double V, exact, published;
  } cases[] = {{0.6, 0.471991674487, 0.471996196}, {1, 0.796805571968, 0.796797853}, {2, 1.612609298722, 1.612637123}};
  for (const auto& [V, exact, published] : cases)
  {
    const Found found = estimate_of(0.3, V);
    CHECK(found.estimate.outcome.kind == OutcomeKind::balance);
    CHECK(found.estimate.amplitude * found.per_y == doctest::Approx(exact).epsilon(1e-10));
    CHECK(found.estimate.amplitude * found.per_y == doctest::Approx(published).epsilon(2e-5));
    CHECK(found.estimate.outcome.residual < 1e-11);
  }
}

// A belt so fast that the sliding never reverses within the six decades leaves lift-off alone.
TEST_CASE("lift-off alone balances weak friction and not strong friction")
{
  const Found weak = estimate_of(0.18, 1e9), strong = estimate_of(0.3, 1e9);
  CHECK(weak.estimate.amplitude * weak.per_y == doctest::Approx(1.574918604).epsilon(2e-9));
  CHECK(strong.estimate.outcome.kind == OutcomeKind::no_balance);
  CHECK(strong.estimate.amplitude == 0);
}

TEST_CASE("at small amplitude the interface and the damping make the mode's growth")
{
  for (const double mu : {0.3, 0.18})
  {
    const Found found = estimate_of(mu, 1);
    const Estimate& estimate = found.estimate;
    const double growth = 2 * found.mode.growth_rate();
    // The reaction is taken at i w instead of lambda, which leaves the inertia of one row times the growth: 1 % here.
    CHECK(estimate.friction_rate_linear - estimate.damping_rate == approx(growth, 0.015));
    // Two decades below the first event, where the curve starts, the force is linear: quadrature and rounding only.
    CHECK(estimate.curve_rate[0] == approx(estimate.friction_rate_linear, 1e-10));
  }
}

TEST_CASE("the start has its reaction at the largest, and is the mode's own motion")
{
  const Found found = estimate_of(0.3, 1);
  const std::complex<double> rho = found.mode.reactions[0] * std::polar(1., found.estimate.phase);
  CHECK(rho.real() == doctest::Approx(std::abs(rho)).epsilon(1e-12));
  const double q = 0.01, h = 1e-4;
  const State start = mode_state(found.equilibrium, found.mode, q, found.estimate.phase);
  const std::complex<double> later = std::exp(found.mode.lambda * h);
  const State next =
      mode_state(found.equilibrium, found.mode, q * std::abs(later), found.estimate.phase + std::arg(later));
  const std::vector<double> u = all_entries(start.u), v = all_entries(start.v), u_next = all_entries(next.u),
                            v_next = all_entries(next.v);
  for (std::size_t i = 0; i < 3; ++i) // trapezoidal rule, error h^3/12 of a motion of size q
    CHECK(std::abs(u_next[i] - u[i] - h * (v[i] + v_next[i]) / 2) < 1e-12 * q);
}
