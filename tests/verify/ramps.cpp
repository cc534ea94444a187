// ranks: 1 2
// Load, drive and friction that change in time, on a mass on a belt, pressed by N and held by a spring k:
//     m x'' + k x = friction,   the belt moves with V(t).
// Exact: a force that rises as t/T from rest gives x = F/(k T) (t - sin(w t)/w), with w^2 = k/m, whether the load rises
// or the friction of a belt that is always faster. On a belt with V = a t the mass sticks, x = a t^2/2, until
// k x + m a = mu N, and then vibrates about mu N/k.
#include "../support/approx.hpp"
#include "../support/oscillator_mode.hpp"

using namespace squeal;
using namespace squeal::test;

namespace
{

constexpr double m = 1.3, k = 2, N = 1.5, mu = 0.4;
const double w = std::sqrt(k / m);

/// x along the belt and y, which contact holds. `along`: a load along the belt.
SmallModel belt(double V, const FrictionLaw& law, double along)
{
  SmallModel model;
  model.structure = test::make_structure(diagonal({m, 1}), diagonal({0, 0}), diagonal({k, 1}), {along, -N});
  model.interface = test::make_interface({{0, 1}, {1, 0}}, 1, {0}, {V}, 0, model.structure.K);
  model.interface.friction = law;
  return model;
}

struct Moved
{
  double position = 0, velocity = 0; // [m], [m/s] of x at the end
  double energy = 0;                 // [J] at the end
  double load = 0, drive = 0, contact = 0;
  double least_heat = 0, largest_defect = 0; // [J] of a step
  int slip = 0, stick = 0;                   // number of steps
  bool ends_stuck = false;
};

/// From rest to `end` in `steps` steps.
Moved move(const SmallModel& model, const Ramps& ramps, double end, int steps, double theta)
{
  const auto& [structure, interface] = model;
  StepOptions options;
  options.contact.tolerance = 1e-13;
  const ThetaStep step = make_theta_step(structure, interface, end / steps, theta, options);
  State state = state_of(structure, {0, 0}, {0, 0});
  StepWork work = begin_steps(step, structure, interface, state);
  Moved moved;
  for (int i = 0; i < steps; ++i)
  {
    const StepReport report = advance(step, structure, interface, work, state, step_factors(ramps, step, state.time));
    REQUIRE(report.contact_converged);
    moved.energy = report.energy;
    moved.load += report.load_work;
    moved.drive += report.drive_work;
    moved.contact += report.contact_work;
    moved.least_heat = std::min(moved.least_heat, report.drive_work - report.contact_work);
    moved.largest_defect = std::max(moved.largest_defect, std::abs(report.energy_defect));
    moved.slip += report.slip;
    moved.stick += report.stick;
    moved.ends_stuck = report.stick == 1;
  }
  moved.position = all_entries(state.u)[0];
  moved.velocity = all_entries(state.v)[0];
  return moved;
}

/// Of a force F that rises as t/T until T and stays.
double ramped(double F, double T, double t)
{
  const auto rising = [&](double s) { return s > 0 ? F / (k * T) * (s - std::sin(w * s) / w) : 0; };
  return rising(t) - rising(t - T);
}

/// The errors of 400 and of 1600 steps: of order two, and small by the bound that the order gives.
void check_second_order(const SmallModel& model, const Ramps& ramps, double end, double exact)
{
  const double coarse = std::abs(move(model, ramps, end, 400, 0.5).position - exact),
               fine = std::abs(move(model, ramps, end, 1600, 0.5).position - exact);
  const double h = end / 400;
  CHECK(coarse < w * w * h * h * w * end * std::abs(exact)); // phase error w^3 h^2 t/12 of a motion about its mean
  CHECK(fine < coarse / 4); // 16, but for where a kink of the force falls in its step: an error of order two as well
}

} // namespace

TEST_CASE("a factor of time is a polygon that is constant outside of its times")
{
  const FactorTable factor{{1, 2, 4}, {3, 5, -1}};
  CHECK(factor_at({}, 7) == 1);
  CHECK(factor_at(factor, 0) == 3);
  CHECK(factor_at(factor, 1.5) == 4);
  CHECK(factor_at(factor, 2) == 5);
  CHECK(factor_at(factor, 3) == 2);
  CHECK(factor_at(factor, 9) == -1);
}

TEST_CASE("a rising load moves the mass as its closed form says")
{
  const double T = 3.3, end = 7.1;
  Ramps ramps;
  ramps.load = {{0, T}, {0, 1}};
  check_second_order(belt(1, {}, 0.7), ramps, end, ramped(0.7, T, end));
}

TEST_CASE("rising friction moves the mass as its closed form says")
{
  const double T = 3.3, end = 7.1;
  Ramps ramps;
  ramps.friction = {{0, T}, {0, 1}};
  for (const double V : {9., -9.}) // faster than the mass gets
    check_second_order(belt(V, {mu}, 0), ramps, end, (V > 0 ? 1 : -1) * ramped(mu * N, T, end));
}

TEST_CASE("on a belt that speeds up the mass sticks, slips and vibrates as its closed form says")
{
  const double a = 0.15, end = 9;
  Ramps ramps;
  ramps.speed = {{0, 2 * end}, {0, 1}};
  const double release = std::sqrt(2 * (mu * N - m * a) / (k * a)), t = end - release;
  REQUIRE(t > 3);
  const double exact = mu * N / k - m * a / k * std::cos(w * t) + a * release / w * std::sin(w * t);
  const SmallModel model = belt(2 * end * a, {mu}, 0);
  check_second_order(model, ramps, end, exact);
  const double before = 0.9 * release;
  const Moved stuck = move(model, ramps, before, 300, 0.5);
  CHECK(stuck.slip == 0);
  CHECK(stuck.velocity == approx(a * before, 1e-11)); // the belt's own velocity, to the tolerance of contact
  // the trapezium of a velocity that is linear in time
  CHECK(stuck.position == approx(a * before * before / 2, 1e-11));
}

TEST_CASE("an application of the brake from standstill to stop balances its energies, and friction gives none")
{
  for (const double theta : {0.5, 0.8})
    for (const int steps : {2000, 5000})
    {
      // the belt speeds up and stops; the mass is pressed on, and friction fades by a third
      Ramps ramps;
      ramps.speed = {{0, 10, 40, 55}, {0, 1, 1, 0}};
      ramps.load = {{0, 5, 60}, {0, 1, 0.8}};
      ramps.friction = {{20, 40}, {1, 0.67}};
      const SmallModel model = belt(0.2, {0.2, true, 0.5, 0.3}, 0);
      const Moved moved = move(model, ramps, 70, steps, theta);
      CHECK(moved.slip > steps / 4);
      CHECK(moved.stick > steps / 4);
      CHECK(moved.ends_stuck);
      CHECK(std::abs(moved.velocity) < 1e-12);
      CHECK(moved.largest_defect < 1e-14);
      // A step in which the belt stops may give back what friction does along the sliding that the belt's ramp of
      // 0.2/15 loses in it.
      const double h = 70. / steps;
      CHECK(moved.least_heat > -0.5 * N * (0.2 / 15) * h * h);
      CHECK(moved.drive > 10 * moved.energy);
      if (theta != 0.5) continue; // the scheme itself takes energy
      CHECK(moved.energy == approx(moved.load + moved.contact, 1e-11));
    }
}
