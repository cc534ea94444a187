// ranks: 1
// A mass on a belt, pressed by N, held by a spring k and a dashpot c, with friction that falls with the sliding speed:
//     m x'' + c x' + k x = N mu(|V - x'|) sign(V - x').
// Steady sliding grows as -(c + N mu'(V))/(2m). The Hopf speed is where that vanishes. The period of stick-slip follows
// from one integration of slip, from the end of stick to where x' = V again, and from stick at x' = V.
#include "../support/approx.hpp"
#include "../support/cycle_of.hpp"
#include "../support/linearised.hpp"
#include "../support/oscillator_mode.hpp"
#include "squeal/transient/theta_step.hpp"

#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>

using namespace squeal;
using namespace squeal::test;

namespace
{

struct Belt
{
  double m = 1.3, c = 0.05, k = 2, N = 1.5, V = 0.4;
  FrictionLaw law{0.2, true, 0.5, 0.3};

  double mu(double speed) const { return law.coefficient + (0.5 - 0.2) * std::exp(-speed / law.decay_speed); }
  double slope(double speed) const { return -(0.5 - 0.2) / law.decay_speed * std::exp(-speed / law.decay_speed); }
  double growth() const { return -(c + N * slope(V)) / (2 * m); }
};

/// x along the belt and y, which contact holds; the normal reaction is N whatever x does.
SmallModel model_of(const Belt& belt)
{
  SmallModel model;
  model.structure =
      test::make_structure(diagonal({belt.m, 1}), diagonal({belt.c, 0}), diagonal({belt.k, 1}), {0, -belt.N});
  model.interface = test::make_interface({{0, 1}, {1, 0}}, 1, {0}, {belt.V}, 0, model.structure.K);
  model.interface.friction = belt.law;
  return model;
}

ComplexMode mode_of(const SmallModel& model, const Equilibrium& equilibrium)
{
  ModesSettings settings;
  Modes modes = test::modes_of(model, equilibrium, settings, {});
  REQUIRE(modes.modes.size() == 1);
  return std::move(modes.modes.front());
}

/// Period of stick-slip: slip by a method of order 8 with fixed steps, its end by Newton on one more step.
double exact_period(const Belt& belt)
{
  using Vector = std::array<double, 2>;
  const auto rates = [&](const Vector& x, Vector& dx, double) {
    dx = {x[1], (belt.N * belt.mu(belt.V - x[1]) - belt.c * x[1] - belt.k * x[0]) / belt.m};
  };
  boost::numeric::odeint::runge_kutta_fehlberg78<Vector> method;
  const double end_of_stick = (belt.N * belt.mu(0) - belt.c * belt.V) / belt.k;
  Vector x = {end_of_stick, belt.V}, last = x;
  constexpr double h = 1e-3; // its error, of order h^8, is below rounding
  double t = 0;
  for (bool left = false; !left || x[1] < belt.V; t += h)
  {
    last = x;
    method.do_step(rates, x, t, h);
    left = left || x[1] < 0;
    REQUIRE(t < 100);
  }
  double part = 0;
  Vector end = last, dx{};
  for (int i = 0; i < 8; ++i)
  {
    end = last;
    method.do_step(rates, end, t - h, part);
    rates(end, dx, 0);
    part -= (end[1] - belt.V) / dx[1];
  }
  REQUIRE(std::abs(end[1] - belt.V) < 1e-13);
  REQUIRE(std::abs(belt.k * end[0] + belt.c * belt.V) < belt.N * belt.mu(0)); // it sticks
  return t - h + part + (end_of_stick - end[0]) / belt.V;
}

} // namespace

TEST_CASE("steady sliding grows as the slope of friction says, whatever becomes of the friction's direction")
{
  for (const double V : {0.1, 0.4, 0.9, 2.})
    for (const bool direction_damping : {true, false})
    {
      Belt belt;
      belt.V = V;
      belt.law.direction_damping = direction_damping;
      const SmallModel model = model_of(belt);
      const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
      CHECK(equilibrium.reactions[1] == approx(belt.N * belt.mu(V), 1e-14)); // the law at the drive's speed
      const ComplexMode mode = mode_of(model, equilibrium);
      const double sigma = belt.growth(), omega = std::sqrt(belt.k / belt.m - sigma * sigma);
      CHECK(std::abs(mode.lambda - std::complex<double>(sigma, omega)) < 1e-13); // of 1
      // what friction gives less what damping takes of the energy, at a vanishing amplitude: 2 sigma, with the energy
      // of a motion at i omega
      const Estimate estimate = estimate_of(model, equilibrium, mode);
      CHECK(estimate.friction_rate_linear - estimate.damping_rate == approx(2 * sigma, 1e-10));
    }
}

TEST_CASE("the Hopf speed is where the fall of friction equals the dashpot")
{
  Belt belt;
  const double exact = belt.law.decay_speed * std::log(belt.N * 0.3 / (belt.c * belt.law.decay_speed));
  const auto growth_at = [&](double V)
  {
    belt.V = V;
    const SmallModel model = model_of(belt);
    return mode_of(model, find_equilibrium(model.structure, model.interface, {})).growth_rate();
  };
  double low = 0.5, high = 3;
  REQUIRE(growth_at(low) > 0);
  REQUIRE(growth_at(high) < 0);
  while (high - low > 1e-12) (growth_at((low + high) / 2) > 0 ? low : high) = (low + high) / 2;
  CHECK(low == approx(exact, 1e-10)); // rounding of the growth over its slope in V
}

TEST_CASE("a step multiplies a small motion by the discrete eigenvalue, and its energy identity is exact")
{
  for (const double theta : {0.5, 0.7})
  {
    const Belt belt;
    const SmallModel model = model_of(belt);
    const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
    const double h = 0.05, small = 1e-5 * belt.law.decay_speed; // curvature of the law: 1e-5 of the change
    StepOptions options;
    options.contact.tolerance = 1e-14;
    const ThetaStep step = make_theta_step(model.structure, model.interface, h, theta, options);
    const Complex z = std::exp(h * discrete_eigenvalue(mode_of(model, equilibrium).lambda, theta, h));
    State state = state_of(model.structure, all_entries(equilibrium.u), {small, 0});
    const double rest = all_entries(equilibrium.u)[0];
    StepWork work = begin_steps(step, model.structure, model.interface, state);
    std::array<double, 3> x{};
    for (int i = 0; i < 60; ++i)
    {
      const StepReport report = advance(step, model.structure, model.interface, work, state);
      CHECK(report.slip == 1); // though its friction is below that of rest
      CHECK(std::abs(report.energy_defect) < 1e-14);
      x = {x[1], x[2], all_entries(state.u)[0] - rest};
      if (i < 2) continue;
      CHECK(std::abs(x[2] - 2 * z.real() * x[1] + std::norm(z) * x[0]) < 1e-4 * h * small);
    }
  }
}

TEST_CASE("friction gives no energy at any speed, and the identity holds through stick and slip")
{
  Belt belt;
  belt.V = 0.15;
  const SmallModel model = model_of(belt);
  const double h = 0.02;
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, 0.5, {});
  State state = state_of(model.structure, {0, 0}, {0, 0});
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  int stick = 0, slip = 0;
  for (int i = 0; i < 2000; ++i)
  {
    const double before = all_entries(state.v)[0];
    const StepReport report = advance(step, model.structure, model.interface, work, state);
    stick += report.stick, slip += report.slip;
    REQUIRE(report.contact_converged);
    CHECK(std::abs(report.energy_defect) < 1e-14);
    const double mean = (before + all_entries(state.v)[0]) / 2 - belt.V, r_t = state.reactions[1];
    CHECK(r_t * mean <= 1e-10 * belt.N * belt.V);              // in stick the mean is what the contact tolerance leaves
    if (report.stick == 0 && std::abs(before - belt.V) > 1e-3) // the law at the mean sliding speed, where that opposes
      CHECK(std::abs(std::abs(r_t) - belt.N * belt.mu(std::abs(mean))) < 1e-9);
  }
  CHECK(stick > 300);
  CHECK(slip > 300);
}

TEST_CASE("stick-slip has the period of slip by quadrature and stick")
{
  Belt belt;
  belt.V = 0.15;
  const double exact = exact_period(belt);
  CAPTURE(exact);
  std::vector<double> errors;
  for (const int steps : {200, 800, 3200})
  {
    const LimitCycle cycle = cycle_of(model_of(belt), steps, 3, 1e-9);
    REQUIRE(cycle.outcome.kind == OutcomeKind::converged);
    CHECK(cycle.multipliers.stability == Stability::stable);
    errors.push_back(cycle.orbit.period / exact - 1);
  }
  CHECK(std::abs(errors.back()) < 1e-6);
  // of order 2 but for the steps in which stick begins and ends, whose share depends on where they fall in the grid
  CHECK(std::abs(errors[0]) / std::abs(errors[2]) > 64);
}

TEST_CASE("a block comes to rest under friction along the lines of a table, of second order, and stays there")
{
  // m v' = -N mu(v), mu = c (1.5 - v) up to v = 0.5: 1.5 - v grows by exp(N c t/m)
  constexpr double m = 2, N = 3, c = 0.3, start = 0.45, end = 0.5, rate = N * c / m;
  SmallModel model;
  model.structure = test::make_structure(diagonal({m, 1}), diagonal({0, 0}), diagonal({0, 1}), {0, -N});
  model.interface = test::make_interface({{0, 1}, {1, 0}}, 1, {0}, {0}, c, model.structure.K);
  model.interface.friction.common.factor_at_speed = {{0, 0.5}, {1.5, 1}};
  const auto speed_after = [&](double time, int steps)
  {
    const ThetaStep step = make_theta_step(model.structure, model.interface, time / steps, 0.5, {});
    State state = state_of(model.structure, {0, 0}, {start, 0});
    StepWork work = begin_steps(step, model.structure, model.interface, state);
    for (int i = 0; i < steps; ++i)
      CHECK(advance(step, model.structure, model.interface, work, state).contact_converged);
    return all_entries(state.v)[0];
  };
  const double exact = 1.5 - (1.5 - start) * std::exp(rate * end);
  const double coarse = std::abs(speed_after(end, 50) - exact), fine = std::abs(speed_after(end, 100) - exact);
  CHECK(fine < 1e-5);
  CHECK(fine < 0.3 * coarse);
  CHECK(std::abs(speed_after(1, 100)) < 1e-10); // it rests from t = ln(1.5/1.05)/rate = 0.79 on
}
