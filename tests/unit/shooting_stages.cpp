// The parts of the shooting solver, each by itself, on smooth oscillators.
#include "../support/smooth_flows.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/shooting/multipliers.hpp"
#include "squeal/shooting/secants.hpp"

#include <cmath>
#include <doctest/doctest.h>
#include <numbers>
#include <numeric>

using namespace squeal;
using namespace squeal::test;

namespace
{

Owned<Vec> state_on_first_rank(const std::vector<double>& u, const std::vector<double>& v)
{
  const Owned<Vec> own_u = on_first_rank(u), own_v = on_first_rank(v);
  return state_of(own_u, own_v);
}

struct Problem
{
  SmoothModel model;
  Preconditioner none{};
  OrbitProblem orbit;
  Progress progress{PETSC_COMM_WORLD, "shooting", 100};
  ConvergenceLog log{progress};

  Problem(const Rate& rate, const std::vector<double>& stiffness, double period)
      : model(make_smooth_model(rate, stiffness)), orbit{model.flow, none, state_of(model.zero, model.zero),
                                                         period,     1e-9, 0}
  {
  }
};

void harmonic(const std::vector<double>& x, std::vector<double>& rate)
{
  rate = {x[1], -x[0]};
}

/// The integral over a period of the divergence of `coupled`'s rate, by the rectangle rule: a smooth periodic function.
double integrated_divergence(const Flow& flow, const Orbit& orbit)
{
  const int samples = 200;
  Owned<Vec> state = copy_of(orbit.state.get()), end = zeros_like(state);
  double sum = 0;
  for (int i = 0; i < samples; ++i)
  {
    flow.integrate(orbit.period / samples, state, end, nullptr);
    std::swap(state, end);
    double squares = 0;
    check(VecNorm(displacement(state), NORM_2, &squares));
    sum += 2 * 0.1 * (1 - squares * squares) * orbit.period / samples;
  }
  return sum;
}

} // namespace

TEST_CASE("the energy norm weighs displacements by K and velocities by M")
{
  const SmoothModel model = make_smooth_model(harmonic, {4});
  const Owned<Vec> state = state_on_first_rank({1.5}, {4});
  CHECK(energy_norm(model.flow, state) == doctest::Approx(5).epsilon(1e-14)); // sqrt(4 1.5^2 + 4^2)
  normalise(model.flow, state);
  CHECK(energy_norm(model.flow, state) == doctest::Approx(1).epsilon(1e-14));
}

TEST_CASE("dependent vectors do not enter the base")
{
  const SmoothModel model = make_smooth_model(coupled, {1, 2});
  const double rank_tolerance = ShootingOptions{}.rank_tolerance;
  std::vector<Owned<Vec>> base;
  const Owned<Vec> a = state_of(model.axes[0], model.zero), b = state_of(model.axes[1], model.zero);
  extend_base(model.flow, rank_tolerance, base, a);
  extend_base(model.flow, rank_tolerance, base, b);
  const Owned<Vec> both = copy_of(a.get());
  check(VecAXPY(both, -3, b));
  extend_base(model.flow, rank_tolerance, base, both);
  REQUIRE(base.size() == 2);
  CHECK(std::abs(energy_product(model.flow, base[0], base[1])) < 1e-14);
  CHECK(energy_norm(model.flow, base[1]) == doctest::Approx(1).epsilon(1e-14));
}

TEST_CASE("one evaluation gives the defect and the rate of a harmonic oscillation")
{
  Problem problem(harmonic, {1}, two_pi);
  const Owned<Vec> state = state_on_first_rank({0.6}, {0.8});
  const Orbit whole = evaluate(problem.orbit, problem.log, state, two_pi);
  // 2000 Runge-Kutta steps a period leave about 1e-12
  CHECK(whole.residual < 1e-11);
  CHECK(whole.fluctuation == doctest::Approx(1).epsilon(1e-14));
  CHECK(energy_norm(problem.model.flow, whole.rate) == doctest::Approx(1).epsilon(1e-10));
  // after half a period the state is turned round: |defect| = 2
  const Orbit half = evaluate(problem.orbit, problem.log, state, std::numbers::pi);
  CHECK(half.residual == doctest::Approx(2).epsilon(1e-10));
  CHECK(problem.log.convergence.periods == 2);
}

TEST_CASE("the period may differ from the first one by a factor of two")
{
  const Problem problem(harmonic, {1}, 1);
  CHECK(admissible_period(problem.orbit, 1.99));
  CHECK(admissible_period(problem.orbit, 0.51));
  CHECK_FALSE(admissible_period(problem.orbit, 2.01));
  CHECK_FALSE(admissible_period(problem.orbit, 0.49));
}

TEST_CASE("the multisecant iteration stops at its target error, which the estimate of the rest holds")
{
  Problem problem(van_der_pol, {1}, 6.3);
  problem.orbit.tolerance = 0; // the target alone ends it
  const ShootingOptions options;
  const Owned<Vec> state = state_on_first_rank({1.9}, {0.3});
  const Orbit start = evaluate(problem.orbit, problem.log, state, 6.5);
  double last = HUGE_VAL;
  for (const double target : {1e-2, 1e-4, 1e-6})
  {
    CAPTURE(target);
    problem.orbit.target_error = target;
    const StageResult found = shoot_once(problem.orbit, options, problem.log, copy_of(start));
    REQUIRE(found.ending == StageEnding::converged);
    CHECK(found.remaining.frequency <= target);
    CHECK(found.remaining.energy <= target);
    CHECK(std::abs(found.orbit.period / vdp_period - 1) <= target);
    CHECK(found.orbit.residual < last);
    last = found.orbit.residual;
  }
}

TEST_CASE("a start at rest collapses")
{
  Problem problem(van_der_pol, {1}, 6.3);
  problem.orbit.least_fluctuation = 1;
  const Owned<Vec> state = state_on_first_rank({0.5}, {0});
  const Orbit start = evaluate(problem.orbit, problem.log, state, 6.3);
  CHECK(collapsing(problem.orbit, start));
}

TEST_CASE("the multipliers' product is the exponential of the integrated divergence (Liouville)")
{
  Problem problem(coupled, {1, 2}, 6.3);
  const ShootingOptions options;
  const Owned<Vec> state = state_on_first_rank({1.9, 0.05}, {0, 0});
  const StageResult found =
      shoot_once(problem.orbit, options, problem.log, evaluate(problem.orbit, problem.log, state, 6.287));
  REQUIRE(found.ending == StageEnding::converged);
  const FloquetAnalysis analysis = find_multipliers(problem.orbit, options, found.orbit);
  const auto& values = analysis.multipliers.values;
  REQUIRE(values.size() == 3);
  const std::complex<double> product =
      std::accumulate(values.begin(), values.end(), std::complex<double>(1), std::multiplies<>());
  CHECK(std::abs(product - std::exp(integrated_divergence(problem.model.flow, found.orbit))) < 1e-5);
  CHECK(analysis.multipliers.trivial_error < 1e-5);
  CHECK(energy_norm(problem.model.flow, analysis.fastest.real) == doctest::Approx(1).epsilon(1e-12));
}
