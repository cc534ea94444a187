// ranks: 1
// Limit cycles of the unilateral oscillator by long integration, against matrix exponentials between events.
#include "../support/oscillator_mode.hpp"
#include "squeal/transient/transient.hpp"

using namespace squeal;

namespace
{

struct Cycle
{
  double mu = 0.3, speed = 0, period = 0, mean_energy = 0;
  int free_periods = 0;
};

} // namespace

TEST_CASE("long integration of the unilateral oscillator falls on its exact limit cycle")
{
  // T and mean energy by matrix exponentials between events; as many periods as the largest multiplier asks for 1e-4
  for (const Cycle& exact :
       {Cycle{0.3, 0.3, 5.938028240916, 0.77336848489, 60}, Cycle{0.3, 0.6, 5.954461004653, 1.77650678461, 30},
        Cycle{0.3, 1, 5.984555109780, 2.44704680486, 30}, Cycle{0.3, 2, 5.993768001880, 4.62721318386, 30}})
  {
    const auto model = test::unilateral_oscillator(exact.mu, exact.speed);
    const test::Sliding sliding = test::persistent_sliding(model, test::at_three_tenths);
    const ThetaStep step = make_theta_step(model.structure, model.interface, exact.period / 400, 0.5, {});
    State state = test::mode_start(sliding, 2 * exact.speed);
    const Owned<Mat> probe = test::sparse({{1, 0, 0}}, {{1, 0, 0}});
    History history;
    march(step, test::view_of(model, sliding), 400 * (exact.free_periods + 10), state, {probe, history, nullptr});
    const std::vector<double>&x = history.probes[0], &energy = history.energy;
    const auto settled = static_cast<std::size_t>(400 * exact.free_periods);
    double mean_x = 0, mean_energy = 0;
    for (std::size_t i = settled; i < settled + 4000; ++i) mean_x += x[i] / 4000, mean_energy += energy[i] / 4000;
    std::vector<double> crossings;
    for (std::size_t i = settled; i + 1 < x.size(); ++i)
      if (x[i] < mean_x && x[i + 1] >= mean_x)
        crossings.push_back(step.h * (static_cast<double>(i) + (mean_x - x[i]) / (x[i + 1] - x[i])));
    REQUIRE(crossings.size() >= 9);
    const double period = (crossings.back() - crossings.front()) / static_cast<double>(crossings.size() - 1);
    CAPTURE(exact.speed);
    CHECK(std::abs(period / exact.period - 1) < 1e-4);
    CHECK(std::abs(mean_energy / exact.mean_energy - 1) < 0.01);
  }
}
