// ranks: 1 2
// Contacts without a drive in time, at rest and in modes, against exact answers.
#include "../support/linearised.hpp"
#include "../support/temporary_folder.hpp"
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

/// A block that a load of 100 N presses onto the ground, on which it rubs with mu = 0.5, held by springs: motions of
/// the block x, of the rubbing foot x, of the foot y. A stiff joint, or a spring k_t, leads from the block to the foot.
SmallModel rubbing_block(double k0, double kt)
{
  SmallModel model;
  const Rows M = test::diagonal({1, 0, 1});
  const Rows K = {{k0 + kt, -kt, 0}, {-kt, kt, 0}, {0, 0, 0}};
  model.structure = test::make_structure(M, test::zeros(3, 3), K, {0, 0, -100});
  model.interface = test::make_interface({{0, 0, 1}, {0, 1, 0}}, 1, {0}, {0}, 0.5, model.structure.K);
  return model;
}

/// A pressed block on a spring, without a friction element.
SmallModel sliding_block(double k)
{
  SmallModel model;
  model.structure = test::make_structure(test::diagonal({1, 1}), test::zeros(2, 2), test::diagonal({k, 0}), {0, -100});
  model.interface = test::make_interface({{0, 1}, {1, 0}}, 1, {0}, {0}, 0.5, model.structure.K);
  return model;
}

/// The turning points of a motion's first entry over so many steps, and the work of the pairs without a drive.
struct Turns
{
  std::vector<double> at;
  double end = 0, work = 0, energy_lost = 0;
};

/// The top of the parabola through three samples.
double top_of(double a, double b, double c)
{
  return b - (c - a) * (c - a) / (8 * (a - 2 * b + c));
}

/// `slip`: positions of friction, empty where it has no elastic slip.
Turns turns_of(const SmallModel& model, const std::vector<double>& start, const std::vector<double>& slip, double h,
               int steps)
{
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, 0.5, {});
  State state{test::vector_like(model.structure.K, start), zeros_like(model.structure.load), 0, {}, slip};
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  const double energy = work.energy;
  Turns turns;
  std::array<double, 3> x{start[0], start[0], start[0]}; // of the last steps, latest first
  for (int i = 0; i < steps; ++i)
  {
    const StepReport report = advance(step, model.structure, model.interface, work, state);
    CHECK(report.contact_converged);
    CHECK(std::abs(report.energy_defect) < 1e-10 * energy);
    turns.work += report.joint_work.at(0);
    x = {all_entries(state.u)[0], x[0], x[1]};
    const double before = x[1] - x[2], after = x[0] - x[1];
    if (i > 0 && before * after < 0) turns.at.push_back(top_of(x[0], x[1], x[2]));
  }
  turns.end = x[0];
  turns.energy_lost = energy - work.energy;
  return turns;
}

/// The largest error of the turns of a block on a spring with a friction element that decays from 0.4, by the exact
/// solution.
double decay_error(const Turns& turns)
{
  const std::vector<double> exact = {-.293422, .209590, -.156682, .133569, -.126882, .125384};
  REQUIRE(turns.at.size() >= exact.size());
  double worst = 0;
  for (std::size_t i = 0; i < exact.size(); ++i) worst = std::max(worst, std::abs(turns.at[i] - exact[i]));
  return worst;
}

/// A pad between the disc it rubs on and the abutment that holds it: motions pad x, y, disc y, bracket x.
SmallModel pad_in_abutment(double force)
{
  SmallModel model;
  const Rows K = test::diagonal({0, 0, 5e7, 3e7});
  model.structure =
      test::make_structure(test::diagonal({1, 1, 1, 1}), test::diagonal({2e3, 2e3, 2e3, 2e3}), K, {0, -force, 0, 0});
  model.interface = test::make_interface({{0, 1, -1, 0}, {1, 0, 0, 0}, {-1, 0, 0, 1}, {0, 1, 0, 0}}, 1, {0, 0}, {1, 0},
                                         0.4, model.structure.K);
  return model;
}

} // namespace

TEST_CASE("a block on a rough plane swings a tenth less each half period, and rests")
{
  const double T = 2 * M_PI / std::sqrt(1000.);
  const Turns turns = turns_of(sliding_block(1000), {0.85, 0}, {}, T / 200, 1000);
  REQUIRE(turns.at.size() >= 7);
  for (std::size_t i = 0; i < 7; ++i)
    CHECK(std::abs(turns.at[i]) == doctest::Approx(0.75 - 0.1 * static_cast<double>(i)).epsilon(4e-4));
  CHECK(turns.end == doctest::Approx(0.05).epsilon(1e-2));
  CHECK(turns.work < 0);
}

TEST_CASE("a spring with a friction element decays to the exact solution as steps get shorter")
{
  const double T = 2 * M_PI / std::sqrt(1000.);
  const auto error_with = [&](int steps_a_period)
  {
    const Turns turns =
        turns_of(rubbing_block(600, 400), {0.4, 0.4 - 50. / 400, 0}, {}, T / steps_a_period, 4 * steps_a_period);
    return decay_error(turns);
  };
  const double coarse = error_with(100), fine = error_with(400);
  CHECK(fine < 5e-4);
  CHECK(fine < 0.35 * coarse); // through onsets of stick the order is between 1 and 2
}

TEST_CASE("a load that rises slowly in time comes to the equilibrium of the path, which locks friction in")
{
  const double force = 1000, exact = force / 1.16;
  const SmallModel model = pad_in_abutment(force);
  const Equilibrium rest = find_equilibrium(model.structure, model.interface, {});
  CHECK(rest.outcome.kind == OutcomeKind::converged);
  CHECK(rest.reactions[0] == doctest::Approx(exact).epsilon(1e-10));
  REQUIRE(rest.history);
  CHECK(rest.force_residual < 1e-12);

  const double h = 2e-4;
  const int steps = 2000;
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, 0.5, {});
  State state{zeros_like(model.structure.load), zeros_like(model.structure.load), 0, {}};
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  for (int i = 0; i < 5 * steps / 4; ++i)
  {
    StepFactors factors;
    factors.load = std::min(1., (i + 0.5) / steps);
    (void)advance(step, model.structure, model.interface, work, state, factors);
  }
  CHECK(state.reactions[0] == doctest::Approx(exact).epsilon(5e-3));
}

TEST_CASE("locked-in friction stays as it is: a start at rest does not move, and nothing drifts")
{
  SmallModel model = pad_in_abutment(1000);
  const auto half = copy_of(model.structure.load.get());
  check(VecScale(half, 0.73));
  model.structure.path.push_back({"press", copy_of(model.structure.load.get()), 1});
  model.structure.path.push_back({"release", copy_of(half.get()), 1});
  model.structure.load = copy_of(half.get());
  const Equilibrium rest = find_equilibrium(model.structure, model.interface, {});
  CHECK(rest.outcome.kind == OutcomeKind::converged);
  CHECK(rest.reactions[0] == doctest::Approx(1000 / 1.16).epsilon(1e-10));
  CHECK(rest.history->stick == 1);
  const ThetaStep step = make_theta_step(model.structure, model.interface, 1e-4, 0.5, {});
  State state{copy_of(rest.u.get()), zeros_like(rest.u), 0, rest.reactions};
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  for (int i = 0; i < 300; ++i) (void)advance(step, model.structure, model.interface, work, state);
  double moved = 0, size = 0;
  check(VecNorm(rest.u, NORM_INFINITY, &size));
  check(VecAXPY(state.u, -1, rest.u));
  check(VecNorm(state.u, NORM_INFINITY, &moved));
  CHECK(moved < 1e-9 * size);
}

TEST_CASE("modes take a pair without a drive as held in all its motions")
{
  // two masses of two motions each, joined by springs; the first stands on the ground
  const double a = 3e4, b = 1e4;
  const Rows K = {{a + 2e4, 1e3, -a, 0}, {1e3, b + 1e4, 0, -b}, {-a, 0, a + 5e3, 2e3}, {0, -b, 2e3, b + 7e3}};
  SmallModel model;
  model.structure = test::make_structure(test::diagonal({1, 1, 2, 2}), test::zeros(4, 4), K, {0, -100, 0, -10});
  model.interface = test::make_interface({{0, 1, 0, 0}, {1, 0, 0, 0}}, 1, {0}, {0}, 0.5, model.structure.K);
  SmallModel held;
  held.structure =
      test::make_structure(test::diagonal({2, 2}), test::zeros(2, 2), {{a + 5e3, 2e3}, {2e3, b + 7e3}}, {0, 0});
  held.interface = test::make_interface({}, 1, {}, {}, 0, held.structure.K);
  const auto eigenvalues_of = [](const SmallModel& of)
  {
    ModesSettings settings;
    settings.band = 1000;
    const Modes modes = test::modes_of(of, find_equilibrium(of.structure, of.interface, {}), settings, {});
    std::vector<double> found;
    for (const ComplexMode& mode : modes.modes) found.push_back(std::abs(mode.lambda.imag()));
    return found;
  };
  const std::vector<double> stuck = eigenvalues_of(model), exact = eigenvalues_of(held);
  REQUIRE(stuck.size() == 2);
  REQUIRE(exact.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) CHECK(stuck[i] == doctest::Approx(exact[i]).epsilon(1e-9));

  ModesSettings settings;
  settings.band = 1000;
  const Equilibrium rest = find_equilibrium(model.structure, model.interface, {});
  const Modes modes = test::modes_of(model, rest, settings, {});
  const std::vector<double> phi = all_entries(modes.modes[0].real);
  const double friction = -a * phi[2], normal = -b * phi[3]; // of the mode, which real shapes leave real
  double first = HUGE_VAL;
  for (const double q : {1., -1.}) // |r_t + q friction| = mu (r_n + q normal)
    for (const double side : {1., -1.})
    {
      const double slope = side * friction * q - .5 * normal * q;
      const double root = (.5 * rest.reactions[0] - side * rest.reactions[1]) / slope;
      if (root > 0) first = std::min(first, root);
    }
  CHECK(test::estimate_of(model, rest, modes.modes[0]).slip_amplitude == doctest::Approx(first).epsilon(1e-6));
}

namespace
{

/// A block on a spring k0 and a spring of compliance c_t in series with its friction, pressed by 100 N.
SmallModel elastic_block(double k0, double kt, double damping)
{
  SmallModel model;
  model.structure =
      test::make_structure(test::diagonal({1, .01}), test::diagonal({damping, 0}), test::diagonal({k0, 0}), {0, -100});
  model.interface = test::make_interface({{0, 1}, {1, 0}}, 1, {0}, {0}, 0.5, model.structure.K);
  model.interface.slip_compliance = {1 / kt};
  return model;
}

/// Half of the last period's peak to peak under a force F cos(omega t), by parabolas through the extremes.
double forced_amplitude(double omega, int steps_a_period)
{
  constexpr double F = 60;
  constexpr int periods = 50;
  const SmallModel model = elastic_block(600, 400, 2);
  const double h = 2 * M_PI / omega / steps_a_period;
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, 0.5, {});
  State state{zeros_like(model.structure.load), zeros_like(model.structure.load), 0, {}};
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  std::vector<double> x;
  for (int i = 0; i < periods * steps_a_period; ++i)
  {
    const double force = F * (std::cos(omega * h * i) + std::cos(omega * h * (i + 1))) / 2;
    check(VecCopy(test::vector_like(model.structure.K, {force, -100}), model.structure.load));
    (void)advance(step, model.structure, model.interface, work, state);
    x.push_back(all_entries(state.u)[0]);
  }
  const std::size_t n = static_cast<std::size_t>(steps_a_period), first = x.size() - n;
  const auto peak = [&](double sign)
  {
    std::size_t top = 0;
    for (std::size_t i = 1; i < n; ++i)
      if (sign * x[first + i] > sign * x[first + top]) top = i;
    return top_of(sign * x[first + (top + n - 1) % n], sign * x[first + top], sign * x[first + (top + 1) % n]);
  };
  return (peak(1) + peak(-1)) / 2;
}

} // namespace

TEST_CASE("elastic slip in series with friction decays to the exact solution, of second order through stick and slip")
{
  const double T = 2 * M_PI / std::sqrt(1000.);
  const auto error_with = [&](int steps_a_period)
  {
    const Turns turns =
        turns_of(elastic_block(600, 400, 0), {.4, 0}, {0, .4 - 50. / 400}, T / steps_a_period, 4 * steps_a_period);
    return decay_error(turns);
  };
  const double coarse = error_with(100), fine = error_with(200);
  CHECK(fine < 2e-4);
  CHECK(fine < 0.35 * coarse);
}

TEST_CASE("a block on a spring and an elastic friction element swings under a force as it does exactly")
{
  for (const auto& [omega, exact] : {std::pair{22., .115858618}, {26., .323049746}, {30., .271085402}})
  {
    const double error = std::abs(forced_amplitude(omega, 200) / exact - 1);
    INFO(omega, " rad/s: ", error);
    CHECK(error < 3.5e-4);
  }
  const double coarse = std::abs(forced_amplitude(26, 100) / .323049746 - 1);
  CHECK(std::abs(forced_amplitude(26, 200) / .323049746 - 1) < 0.35 * coarse);
}

TEST_CASE("elastic slip holds a rest with locked-in friction where it is, and takes its own place in a state file")
{
  SmallModel model = pad_in_abutment(1000);
  model.interface.slip_compliance = {0, 2e-8};
  const Equilibrium rest = find_equilibrium(model.structure, model.interface, {});
  CHECK(rest.outcome.kind == OutcomeKind::converged);
  CHECK(rest.force_residual < 1e-12);
  const ThetaStep step = make_theta_step(model.structure, model.interface, 1e-4, 0.5, {});
  State state{copy_of(rest.u.get()), zeros_like(rest.u), 0, rest.reactions};
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  const std::vector<double> slip = state.slip;
  for (int i = 0; i < 300; ++i) (void)advance(step, model.structure, model.interface, work, state);
  double moved = 0, size = 0;
  check(VecNorm(rest.u, NORM_INFINITY, &size));
  check(VecAXPY(state.u, -1, rest.u));
  check(VecNorm(state.u, NORM_INFINITY, &moved));
  CHECK(moved < 1e-9 * size);
  const test::TemporaryFolder folder;
  write_state(state, model.structure, folder.path / "state");
  CHECK(read_state(folder.path / "state", model.structure).slip == state.slip);
}

TEST_CASE("modes with elastic slip tend to those of stick with the first power of its compliance")
{
  const double a = 3e4, b = 1e4;
  const Rows K = {{a + 2e4, 1e3, -a, 0}, {1e3, b + 1e4, 0, -b}, {-a, 0, a + 5e3, 2e3}, {0, -b, 2e3, b + 7e3}};
  const auto eigenvalues_with = [&](double slip_compliance)
  {
    SmallModel model;
    model.structure = test::make_structure(test::diagonal({1, 1, 2, 2}), test::zeros(4, 4), K, {0, -100, 0, -10});
    model.interface = test::make_interface({{0, 1, 0, 0}, {1, 0, 0, 0}}, 1, {0}, {0}, 0.5, model.structure.K);
    if (slip_compliance > 0) model.interface.slip_compliance = {slip_compliance};
    ModesSettings settings;
    settings.band = 1e6;
    std::vector<double> found;
    const Equilibrium rest = find_equilibrium(model.structure, model.interface, {});
    for (const ComplexMode& mode : test::modes_of(model, rest, settings, {}).modes)
      found.push_back(std::abs(mode.lambda.imag()));
    std::ranges::sort(found);
    return found;
  };
  const std::vector<double> stuck = eigenvalues_with(0), some = eigenvalues_with(1e-9), less = eigenvalues_with(1e-10);
  REQUIRE(stuck.size() == 2);
  REQUIRE(some.size() == 3); // one more, of the mass on the elastic slip
  for (std::size_t i = 0; i < 2; ++i)
  {
    CHECK(std::abs(some[i] / stuck[i] - 1) < 1e-4);
    CHECK((less[i] - stuck[i]) / (some[i] - stuck[i]) == doctest::Approx(0.1).epsilon(1e-2));
  }
}
