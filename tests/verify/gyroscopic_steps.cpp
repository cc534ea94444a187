// ranks: 1 2
// Steps with a gyroscopic part G, which does no work: the discrete eigenvalues are those of the modes with it, energy
// closes, and the tangent is the difference quotient. A spinning mass on springs k has the frequencies
// sqrt(k/m + (g/2m)^2) +- g/2m.
#include "../support/linearised.hpp"
#include "../support/step_checks.hpp"

using namespace squeal;
using namespace squeal::test;

namespace
{

/// The sliding oscillator with G = g between its two motions of the pad.
SmallModel gyroscopic_oscillator(double mu, double belt, double g)
{
  SmallModel model = unilateral_oscillator(mu, belt);
  const Rows all = {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
  model.structure.G = sparse({{0, g, 0}, {-g, 0, 0}, {0, 0, 0}}, all);
  return model;
}

} // namespace

TEST_CASE("a spinning mass whirls at its two exact frequencies, as the steps show them")
{
  const double m = 2, k = 3;
  for (const double g : {0.3, 4.})
  {
    SmallModel model;
    model.structure = test::make_structure(diagonal({m, m}), zeros(2, 2), diagonal({k, k}), {0, 0});
    model.structure.G = sparse({{0, g}, {-g, 0}}, {{1, 1}, {1, 1}});
    model.interface = test::make_interface(zeros(0, 2), 1, {}, {}, 0, model.structure.K);
    const double h = 0.05, split = g / (2 * m), mean = std::sqrt(k / m + split * split);
    const ThetaStep step = make_theta_step(model.structure, model.interface, h, 0.5, {});
    for (const double w : {split + mean, split - mean}) // -m w^2 + g w + k = 0 of u = (cos w t, sin w t)
    {
      State state = state_of(model.structure, {1, 0}, {0, w});
      StepWork work = begin_steps(step, model.structure, model.interface, state);
      const double turned = 2 * std::atan(w * h / 2); // of the discrete eigenvalue
      for (int i = 1; i <= 200; ++i)
      {
        const StepReport report = advance(step, model.structure, model.interface, work, state);
        CHECK(std::abs(report.energy_defect) < 1e-13);
        const std::vector<double> u = all_entries(state.u);
        CHECK(std::abs(u[0] - std::cos(i * turned)) < 1e-11); // rounding of the steps
        CHECK(std::abs(u[1] - std::sin(i * turned)) < 1e-11);
      }
    }
  }
}

TEST_CASE("a step multiplies a small sliding motion with G by the discrete eigenvalue")
{
  for (const double g : {0.2, -0.8})
  {
    const SmallModel model = gyroscopic_oscillator(0.3, 1, g);
    const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
    ModesSettings settings;
    const Modes modes = test::modes_of(model, equilibrium, settings, {});
    REQUIRE(!modes.modes.empty());
    for (const double theta : {0.5, 0.7}) check_discrete_motion(model, equilibrium, modes.modes.front(), theta);
  }
}

TEST_CASE("the tangent of steps with G through stick and lift-off is the difference quotient of the steps")
{
  for (const double g : {0.2, -0.8})
    check_tangent(gyroscopic_oscillator(0.3, 0.6, g), {{0.2, -2.4, -0.8}, {0.9, 0.1, -0.3}, {1, 0, 0}, {0, 1, 0}});
}

TEST_CASE("a step that is too long for G is refused")
{
  const SmallModel model = gyroscopic_oscillator(0.3, 1, 100);
  const ThetaStep step = make_theta_step(model.structure, model.interface, 1, 0.5, {});
  State state = state_of(model.structure, {0, 0, 0}, {1, 0, 0});
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  CHECK_THROWS_AS((void)advance(step, model.structure, model.interface, work, state), Error);
}
