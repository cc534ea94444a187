// Where theta and the step size make growth rates wrong: the boundary from both sides, and the refusals that guard it.
#include "../support/oscillator_mode.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/transient/transient.hpp"

#include <cmath>
#include <doctest/doctest.h>
#include <numbers>

using namespace squeal;

namespace
{

/// The weakly unstable oscillator: 0.07 % above the critical friction.
const double weak = 0.1785;

double period_of(const ComplexMode& mode)
{
  return two_pi / mode.lambda.imag();
}

/// |theta - 1/2| decides it exactly at this many steps a period.
double boundary(const ComplexMode& mode, double theta)
{
  return std::abs(theta - 0.5) * std::norm(mode.lambda) * period_of(mode) / mode.lambda.real();
}

/// Growth rate fitted to a march of four periods.
double marched(const test::SmallModel& model, const test::Sliding& sliding, double theta, double h)
{
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, theta, {});
  State state = test::mode_start(sliding, 0.05);
  History history;
  ModeAmplitude amplitude = follow(model.structure, sliding.equilibrium, sliding.mode);
  const long steps = std::lround(std::ceil(4.2 * period_of(sliding.mode) / h));
  march(step, test::view_of(model, sliding), steps, state,
        {nullptr, history, [&](const State& now, const StepReport&, const StepWork& work) {
           observe(amplitude, now.time, work.Ku, work.Mv);
         }});
  return growth_rate(amplitude, period_of(sliding.mode));
}

/// Re(lambda_h)/Re(lambda) - 1: the part of the growth rate that the step adds or takes.
double growth_bias(std::complex<double> lambda, double theta, double h)
{
  return discrete_eigenvalue(lambda, theta, h).real() / lambda.real() - 1;
}

} // namespace

TEST_CASE("theta > 1/2: an unstable mode looks stable below the stated number of steps, and is refused there only")
{
  const auto model = test::unilateral_oscillator(weak, 1);
  const auto sliding = test::persistent_sliding(model, test::Complex(0.0007, 1.06));
  const double sigma = sliding.mode.lambda.real();
  REQUIRE(sigma > 0);
  for (const double theta : {0.502, 0.51, 0.55})
  {
    CAPTURE(theta);
    const double steps = boundary(sliding.mode, theta);
    // the boundary is sharp: 2 % on either side; the discrete rate there is 2 % of sigma
    const double fine = period_of(sliding.mode) / (1.02 * steps), coarse = period_of(sliding.mode) / (0.98 * steps);
    CHECK(step_refusal(&sliding.mode, theta, fine, {}).empty());
    CHECK(marched(model, sliding, theta, fine) > 0.01 * sigma);
    CHECK(growth_bias(sliding.mode.lambda, theta, fine) > -1);
    const std::string reason = step_refusal(&sliding.mode, theta, coarse, {});
    CHECK(reason.find("would look stable") != std::string::npos);
    CHECK(reason.find("or theta = 1/2") != std::string::npos);
    CHECK(marched(model, sliding, theta, coarse) < -0.01 * sigma);
    CHECK(growth_bias(sliding.mode.lambda, theta, coarse) < -1);
  }
  // theta = 1/2 never changes the sign, however coarse: (1 - (omega h)^2/4) of the rate at small omega h
  for (const double steps : {7., 25., 400.})
  {
    const double h = period_of(sliding.mode) / steps;
    CHECK(step_refusal(&sliding.mode, 0.5, h, {}).empty());
    CHECK(growth_bias(sliding.mode.lambda, 0.5, h) < 0);
    CHECK(growth_bias(sliding.mode.lambda, 0.5, h) > -0.25 * std::norm(sliding.mode.lambda) * h * h);
  }
}

TEST_CASE("theta < 1/2: growth that is mostly the step's own is refused")
{
  auto model = test::unilateral_oscillator(weak, 1);
  const auto sliding = test::persistent_sliding(model, test::Complex(0.0007, 1.06));
  const double h = period_of(sliding.mode) / (0.98 * boundary(sliding.mode, 0.49));
  CHECK(growth_bias(sliding.mode.lambda, 0.49, h) > 1);
  CHECK(step_refusal(&sliding.mode, 0.49, h, {}).find("owe most of its growth") != std::string::npos);
  const double fine = period_of(sliding.mode) / (1.02 * boundary(sliding.mode, 0.49));
  CHECK(growth_bias(sliding.mode.lambda, 0.49, fine) < 1);
  CHECK(step_refusal(&sliding.mode, 0.49, fine, {}).empty());
}

TEST_CASE("the refusal is lifted by its option only")
{
  ComplexMode mode;
  mode.lambda = {0.001, 1};
  CHECK_FALSE(step_refusal(&mode, 0.6, 1, {}).empty());
  CHECK(step_refusal(&mode, 0.6, 1, {.refuse = false}).empty());
}

namespace
{

/// Masses in a row on a belt, each pressed by 1 and tied to the next one.
test::SmallModel row_on_belt(std::size_t masses, const FrictionLaw& law, double mass)
{
  test::SmallModel model;
  const std::size_t n = 2 * masses;
  test::Rows K = test::diagonal(std::vector<double>(n, 1.)), B = test::zeros(n, n);
  std::vector<double> load(n, 0.), all(n, 1.);
  for (std::size_t i = 0; i < masses; ++i)
  {
    B[2 * i][2 * i + 1] = B[2 * i + 1][2 * i] = 1; // x slides, y is pressed
    load[2 * i + 1] = -1;
    all[2 * i] = mass;
    if (i > 0) K[2 * i][2 * i - 2] = K[2 * i - 2][2 * i] = -0.3;
  }
  model.structure = test::make_structure(test::diagonal(all), test::zeros(n, n), K, load);
  model.interface = test::make_interface(B, 1, std::vector<double>(masses, 0.), std::vector<double>(masses, 0.5), 0,
                                         model.structure.K);
  model.interface.friction = law;
  return model;
}

} // namespace

TEST_CASE("a step that may have several solutions under falling friction is refused, with the steps that have one")
{
  const FrictionLaw law{0.2, true, 0.6, 0.01};
  for (const std::size_t masses : {1, 5})
  {
    const test::SmallModel model = row_on_belt(masses, law, 2);
    const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
    const SlidingEquilibrium sliding{model.structure, model.interface, equilibrium};
    // the softest motion of the row has the stiffness 1 - 0.6 cos(pi/(masses + 1))
    const double k = masses == 1 ? 1 : 1 - 0.6 * std::cos(std::numbers::pi / static_cast<double>(masses + 1));
    const auto fall = [&](double h, double theta) { return theta * 0.4 / 0.01 * h / (2 + h * h * theta * theta * k); };
    for (const double theta : {0.5, 0.8})
      for (const double h : {0.01, 0.08, 0.3})
      {
        const ThetaStep step = make_theta_step(model.structure, model.interface, h, theta, {});
        CHECK(fall_of_friction(step, model.interface, equilibrium.reactions) ==
              doctest::Approx(fall(h, theta)).epsilon(1e-3)); // thirty passes of power iteration
        CHECK(friction_refusal(sliding, nullptr, theta, h, {}, 1).empty() == (fall(h, theta) < 1));
        CHECK(friction_refusal(sliding, nullptr, theta, h, {.refuse = false}, 1).empty());
      }
    ComplexMode mode;
    mode.lambda = {0.1, 1};
    const std::string reason = friction_refusal(sliding, &mode, 0.5, 0.3, {}, 1);
    const std::size_t end = reason.find(" steps a period would do");
    REQUIRE(end != std::string::npos);
    const double steps = std::stod(reason.substr(reason.rfind(' ', end - 1)));
    const double enough = two_pi / steps;
    CHECK(friction_refusal(sliding, &mode, 0.5, enough, {}, 1).empty());
    CHECK(fall(enough, 0.5) > 0.5); // not far too many
  }
  const test::SmallModel rising = row_on_belt(1, {0.6, true, 0.2, 0.01}, 2);
  const Equilibrium equilibrium = find_equilibrium(rising.structure, rising.interface, {});
  CHECK(friction_refusal({rising.structure, rising.interface, equilibrium}, nullptr, 0.5, 1, {}, 1).empty());
}

TEST_CASE("where contact nodes have no mass, no step has one solution under falling friction, and the refusal says so")
{
  const test::SmallModel model = row_on_belt(1, {0.2, true, 0.6, 0.01}, 0);
  const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
  const std::string reason =
      friction_refusal({model.structure, model.interface, equilibrium}, nullptr, 0.5, 0.1, {}, 1);
  CHECK(reason.find("no shorter step would do") != std::string::npos);
}

TEST_CASE("a transient whose reactions outgrow the guard says that steps may have had several solutions")
{
  test::SmallModel model = row_on_belt(1, {0.2, true, 0.6, 0.02}, 2); // |mu'| W = 0.9 at rest with the load of 1
  const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
  TransientSettings settings;
  settings.steps = 40;
  settings.step_size = 0.18;
  State start = test::state_of(model.structure, {0, 0}, {0, 0});
  const SlidingEquilibrium sliding{model.structure, model.interface, equilibrium};
  CHECK(integrate(sliding, nullptr, settings, {}, copy_of(start), nullptr).outcome.kind == OutcomeKind::completed);
  start = test::state_of(model.structure, {0, 0}, {0, -0.5}); // strikes the belt
  const Trajectory trajectory = integrate(sliding, nullptr, settings, {}, copy_of(start), nullptr);
  CHECK(trajectory.outcome.kind == OutcomeKind::not_converged);
  CHECK(trajectory.outcome.reason.find("several solutions") != std::string::npos);
}
