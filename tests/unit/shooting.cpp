// The whole shooting on smooth oscillators, which know no brake, against their periods, amplitudes and multipliers.
#include "squeal/shooting/shooting.hpp"
#include "../support/smooth_flows.hpp"
#include "squeal/base/constants.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;

namespace
{

ShootingResult shoot_from(const SmoothModel& model, const std::vector<double>& u, double period, int free_periods,
                          const ShootingOptions& options)
{
  const Owned<Vec> start = on_first_rank(u);
  ShootingStart at{model.zero, start, model.zero, period};
  for (const auto& axis : model.axes) at.shapes.push_back(axis);
  return shoot(model.flow, {}, at, {1e-9, free_periods}, options);
}

double largest_amplitude(const SmoothModel& model, const Orbit& orbit)
{
  // x is extreme where v = 0: a short way along the cycle is integrated until v changes sign
  Owned<Vec> state = copy_of(orbit.state.get()), end = zeros_like(state);
  double largest = 0;
  for (int i = 0; i < 400; ++i)
  {
    model.flow.integrate(orbit.period / 400, state, end, nullptr);
    std::swap(state, end);
    double x = 0;
    check(VecNorm(displacement(state), NORM_INFINITY, &x));
    largest = std::max(largest, x);
  }
  return largest;
}

} // namespace

TEST_CASE("shooting on a subspace spans a one-degree system and finds the van der Pol cycle")
{
  const SmoothModel model = make_smooth_model(van_der_pol, {1});
  ShootingOptions options;
  options.finish = Finish::none;
  options.subspace_newtons = 10;
  const ShootingResult cycle = shoot_from(model, {1.5}, 6.3, 0, options);
  CHECK(cycle.outcome.kind == OutcomeKind::converged);
  CHECK(cycle.orbit.period == doctest::Approx(vdp_period).epsilon(1e-8));
  // 400 samples of a parabola at its top miss at most (pi/400)^2 of it
  CHECK(largest_amplitude(model, cycle.orbit) == doctest::Approx(vdp_amplitude).epsilon(1e-4));
  CHECK(cycle.convergence.records.back().unknowns == 3);
  CHECK(cycle.convergence.residual_projected < 1e-9);
  CHECK(cycle.convergence.periods > cycle.convergence.iterations);
}

TEST_CASE("multipliers of the van der Pol cycle: one, and a strong contraction")
{
  const SmoothModel model = make_smooth_model(van_der_pol, {1});
  const ShootingResult cycle = shoot_from(model, {1.5}, 6.3, 2, {});
  REQUIRE(cycle.multipliers.values.size() == 1); // the shift in time is told apart
  CHECK(cycle.multipliers.trivial_error < 1e-7);
  CHECK(std::abs(cycle.multipliers.values[0] - vdp_multiplier) < 1e-7);
  CHECK(cycle.multipliers.stability == Stability::stable);
  CHECK(cycle.multipliers.periods == 3 * 2); // on three grids of time
}

TEST_CASE("the multisecant finish agrees with the reference")
{
  SmoothModel model = make_smooth_model(van_der_pol, {1});
  model.flow.apply_tangent = nullptr; // which leaves a small system to secants of its own steps
  ShootingOptions options;
  options.multipliers = 0;
  const ShootingResult cycle = shoot_from(model, {1.5}, 6.3, 2, options);
  CHECK(cycle.outcome.kind == OutcomeKind::converged);
  CHECK(cycle.orbit.residual < 1e-9);
  CHECK(cycle.orbit.period == doctest::Approx(vdp_period).epsilon(1e-8));
  CHECK(cycle.convergence.records.back().stage == ShootingStage::multisecant);
}

TEST_CASE("of two coexisting cycles the start decides")
{
  const SmoothModel model = make_smooth_model(coupled, {1, 2});
  const ShootingResult first = shoot_from(model, {1.8, 0.2}, 6.3, 10, {});
  CHECK(first.outcome.kind == OutcomeKind::converged);
  CHECK(first.orbit.period == doctest::Approx(6.287111272289).epsilon(1e-8));
  CHECK(first.multipliers.stability == Stability::stable);
  const ShootingResult second = shoot_from(model, {0.2, 1.8}, 4.44, 10, {});
  CHECK(second.outcome.kind == OutcomeKind::converged);
  CHECK(second.orbit.period == doctest::Approx(4.444271158025).epsilon(1e-8));
}

TEST_CASE("a decaying oscillation has no cycle: collapsed, not converged")
{
  const auto damped = [](const std::vector<double>& x, std::vector<double>& rate) {
    rate = {x[1], -0.1 * x[1] - x[0]};
  };
  const SmoothModel model = make_smooth_model(damped, {1});
  const ShootingResult cycle = shoot_from(model, {1}, 6.3, 2, {});
  CHECK(cycle.outcome.kind == OutcomeKind::collapsed_to_equilibrium);
}

TEST_CASE("a cycle that repels is no result: van der Pol in reversed time has no other")
{
  const auto reversed = [](const std::vector<double>& x, std::vector<double>& rate) {
    rate = {x[1], -(1 - x[0] * x[0]) * x[1] - x[0]};
  };
  const SmoothModel model = make_smooth_model(reversed, {1});
  const ShootingResult cycle = shoot_from(model, {vdp_amplitude}, vdp_period, 0, {});
  CHECK(cycle.orbit.residual < 1e-9);
  CHECK(cycle.outcome.kind == OutcomeKind::unstable_cycle);
  CHECK(cycle.outcome.reason.find("repels") != std::string::npos);
  CHECK(cycle.multipliers.stability == Stability::unstable);
  REQUIRE(cycle.multipliers.values.size() == 1);
  // the reciprocal of the attracting one; the orbit's own residual counts a thousandfold
  CHECK(cycle.multipliers.values[0].real() == doctest::Approx(1 / vdp_multiplier).epsilon(1e-4));
}

TEST_CASE("a cycle that repels is left for one that attracts")
{
  // x'' + d (1 - 5 x^2 + 2 x^4) x' + x = 0. An amplitude a changes by -d a/8 (a^2 - 1)(a^2 - 4) to first order in d:
  // rest attracts, a = 1 repels, a = 2 attracts.
  const auto rate_of = [](const std::vector<double>& x, std::vector<double>& rate)
  {
    const double q = x[0] * x[0];
    rate = {x[1], -0.1 * (1 - 5 * q + 2 * q * q) * x[1] - x[0]};
  };
  const SmoothModel model = make_smooth_model(rate_of, {1});
  const ShootingResult cycle = shoot_from(model, {1}, 6.28, 0, {});
  CHECK(cycle.outcome.kind == OutcomeKind::converged);
  CHECK(cycle.multipliers.stability == Stability::stable);
  CHECK(largest_amplitude(model, cycle.orbit) == doctest::Approx(2).epsilon(0.01)); // first order in d
  // the one that repels was met first
  const auto met = std::count_if(cycle.convergence.records.begin(), cycle.convergence.records.end(),
                                 [](const NewtonRecord& entry) { return entry.residual_full < 1e-9; });
  CHECK(met >= 2);
}

TEST_CASE("a cycle that motions leave by a thousandth only is not called unstable")
{
  // The amplitude a = 1 + e follows e' = 0.1 e (1 - |e|/1e-3): the tangent at e = 0 grows, all motions come to 1e-3.
  const auto rate_of = [](const std::vector<double>& x, std::vector<double>& rate)
  {
    const double amplitude = std::hypot(x[0], x[1]), e = amplitude - 1;
    const double growth = 0.1 * e * (1 - std::abs(e) / 1e-3) / amplitude;
    rate = {x[1] + growth * x[0], -x[0] + growth * x[1]};
  };
  const SmoothModel model = make_smooth_model(rate_of, {1});
  const ShootingResult cycle = shoot_from(model, {1}, two_pi, 0, {});
  CHECK(cycle.outcome.kind == OutcomeKind::converged);
  CHECK(cycle.multipliers.stability == Stability::undecided);
  CHECK(cycle.multipliers.would_decide.find("% beside the cycle") != std::string::npos);
  REQUIRE(cycle.multipliers.values.size() == 1);
  // the tangent's own differences of 1e-6 see 1e-6/1e-3 less growth
  CHECK(cycle.multipliers.values[0].real() == doctest::Approx(std::exp(0.1 * two_pi)).epsilon(2e-3));
}

TEST_CASE("a cycle that repels along a flat ellipse is called unstable")
{
  // x has a circle of radius 1 and period 2 pi that attracts. y beside it turns by 0.28 of a turn a period and
  // grows 1.3 times, on an ellipse that the energy norm makes 50 times as long as wide: its distance may fall to a
  // quarter first.
  const double growth = std::log(1.3) / two_pi, omega = 0.28;
  const auto rate_of = [=](const std::vector<double>& x, std::vector<double>& rate)
  {
    const double e = std::hypot(x[0], x[2]) - 1;
    rate = {x[2] - e * x[0], x[3], -x[0] - e * x[2],
            2 * growth * (1 - x[1] * x[1]) * x[3] - (omega * omega + growth * growth) * x[1]};
  };
  const SmoothModel model = make_smooth_model(rate_of, {1, std::pow(50 * omega, 2)});
  const ShootingResult cycle = shoot_from(model, {1, 0}, two_pi, 0, {});
  CHECK(cycle.outcome.kind == OutcomeKind::unstable_cycle);
  CHECK(cycle.multipliers.stability == Stability::unstable);
  CHECK(cycle.multipliers.crossing == Crossing::neimark_sacker);
  CHECK(std::abs(cycle.multipliers.values.front()) == doctest::Approx(1.3).epsilon(1e-4));
}

TEST_CASE("an orbit gone round twice is taken for one that closes in half the period")
{
  const SmoothModel model = make_smooth_model(van_der_pol, {1});
  const ShootingResult cycle = shoot_from(model, {2}, 13, 0, {});
  CHECK(cycle.outcome.kind == OutcomeKind::converged);
  CHECK(cycle.orbit.period == doctest::Approx(vdp_period).epsilon(1e-8));
  const auto& records = cycle.convergence.records;
  CHECK(std::any_of(records.begin(), records.end(),
                    [](const NewtonRecord& entry) { return std::abs(entry.period / (2 * vdp_period) - 1) < 1e-8; }));
}

TEST_CASE("too few periods leave no cycle, and the reason says how many there were")
{
  const SmoothModel model = make_smooth_model(van_der_pol, {1});
  ShootingOptions options;
  options.max_periods = 3;
  const ShootingResult cycle = shoot_from(model, {0.5}, 6.3, 3, options);
  CHECK(cycle.outcome.kind == OutcomeKind::not_converged);
  CHECK(cycle.outcome.reason.find(std::to_string(cycle.convergence.periods) + " periods") != std::string::npos);
  CHECK(cycle.multipliers.stability == Stability::not_examined);
}
