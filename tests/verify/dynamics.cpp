// ranks: 1 2 3
// Exact-contact dynamics against exact answers, on models small enough to have them.
#include "../support/approx.hpp"
#include "../support/oscillator_mode.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/transient/transient.hpp"

#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using test::at_three_tenths, test::Complex, test::mode_start, test::persistent_sliding, test::Sliding, test::state_of;

namespace
{

/// The gap of pair 0 of a state.
double gap_of(const Interface& interface, Vec u)
{
  return interface.gap[0] + relative(interface, u)[0];
}

/// Free energy of a state in its load: v'Mv/2 + u'Ku/2 - F'u.
double energy_in_load(const Structure& structure, const State& state, double energy)
{
  double work = 0;
  check(VecDot(structure.load, state.u, &work));
  return energy - work;
}

} // namespace

TEST_CASE("a falling mass meets the ground in the step of its impact, and stays")
{
  const auto model = test::mass_spring_chain(1, 2, 0, 1, -9.81);
  const double h = 4e-3, impact = std::sqrt(2 / 9.81);
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, 0.5, {});
  State state = state_of(model.structure, {0}, {0});
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  double first = 0;
  for (int i = 0; i < 170; ++i)
  {
    const StepReport report = advance(step, model.structure, model.interface, work, state);
    const double height = gap_of(model.interface, state.u);
    // free fall is a parabola, which theta = 1/2 integrates exactly
    if (first == 0 && report.open == 1) CHECK(std::abs(height - (1 - 9.81 * state.time * state.time / 2)) < 1e-12);
    if (first == 0 && report.open == 0) first = state.time;
    if (first > 0 && state.time > first + 2.5 * h) // an inelastic shock takes two steps
    {
      CHECK(std::abs(height) < 1e-10 * 9.81 * h * h);                // the contact tolerance, over a step
      CHECK(std::abs(all_entries(state.v)[0]) < 1e-10 * 9.81 * h);   // the same, of W r = 9.81 h
      CHECK(std::abs(state.reactions[0] - 2 * 9.81) < 1e-9 * 19.62); // contact tolerance
    }
  }
  CHECK(std::abs(first - impact) <= h);
}

TEST_CASE("a pressed mass stays pressed, whatever the rounding of its gap")
{
  for (const double gap : {0., 1e-20, -1e-20})
  {
    CAPTURE(gap);
    const auto model = test::mass_spring_chain(1, 2, 0, gap, -9.81);
    const ThetaStep step = make_theta_step(model.structure, model.interface, 1e-3, 0.5, {});
    State state = state_of(model.structure, {0}, {0});
    StepWork work = begin_steps(step, model.structure, model.interface, state);
    for (int i = 0; i < 8; ++i)
    {
      const StepReport report = advance(step, model.structure, model.interface, work, state);
      CHECK(report.open == 0);
      CHECK(std::abs(state.reactions[0] - 19.62) < 1e-10 * 19.62);                        // the contact tolerance
      CHECK(std::abs(gap_of(model.interface, state.u)) < 1e-10 * 9.81 * step.h * step.h); // 1e-15 m
    }
  }
}

namespace
{

/// Bar of Doyen, Ern, Piperno 2011: E 900, rho 1, length 10, weight 10, dropped from 5; elements of one tenth of the
/// time a wave takes through them.
struct Bounce
{
  double release = 0, gap_error = 0, top_error = 0, loss = 0, pressure = 0, gain = 0, gap_min = 0;
};

Bounce bouncing_bar(int elements)
{
  const double length = 10. / elements;
  const auto model = test::mass_spring_chain(elements + 1, length, 900 / length, 5, -10);
  const std::vector<double> zero(static_cast<std::size_t>(elements) + 1, 0);
  const int steps_per_second = 10 * elements; // h = 0.3 of an element's length over the wave speed
  const ThetaStep step = make_theta_step(model.structure, model.interface, 1. / steps_per_second, 0.5, {});
  State state = state_of(model.structure, zero, zero);
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  Bounce bounce;
  double impulse = 0, energy = 0;
  for (int i = 1; i <= 8 * steps_per_second / 3; ++i)
  {
    const StepReport report = advance(step, model.structure, model.interface, work, state);
    if (report.open == 0) bounce.release = state.time;
    if (state.time > 1.2 && state.time <= 1.4) impulse += step.h * state.reactions[0];
    bounce.gain = std::max(bounce.gain, report.contact_work / report.energy);
    // what the law keeps open is u + h v/2
    const auto u = all_entries(state.u), v = all_entries(state.v);
    bounce.gap_min = std::min(bounce.gap_min, 5 + u[0] + step.h * v[0] / 2);
    if (i == 2 * steps_per_second)
    {
      bounce.gap_error = std::abs(5 + u[0] - 5. / 3);
      bounce.top_error = std::abs(u[static_cast<std::size_t>(elements)] + 20. / 9);
    }
    energy = energy_in_load(model.structure, state, report.energy);
  }
  bounce.loss = -energy; // it started with none
  bounce.pressure = impulse / 0.2;
  return bounce;
}

} // namespace

TEST_CASE("a bouncing bar takes off when its wave comes back, and loses an energy that falls with its elements")
{
  const Bounce coarse = bouncing_bar(20), fine = bouncing_bar(40);
  CHECK(std::abs(fine.release - 5. / 3) < 3 * 0.25 / 30); // three elements of the front's way
  CHECK(std::abs(fine.pressure - 390) < 4);               // mean of 300 + 300 (t - 1), behind the front's ripple
  CHECK(fine.gap_error < 0.01);
  CHECK(fine.top_error < 0.12); // the front passes there: slowest
  CHECK(coarse.top_error / fine.top_error > 1.5);
  CHECK(fine.gain < 1e-14); // theta = 1/2: no step gains energy from normal contact
  CHECK(fine.gap_min > -1e-12);
  CHECK(fine.loss > 0);
  CHECK(coarse.loss / fine.loss == doctest::Approx(2).epsilon(0.01)); // the end mass's kinetic energy
}

TEST_CASE("an impact leaves no penetration")
{
  const auto model = test::mass_spring_chain(1, 2, 0, 1, -9.81);
  const ThetaStep step = make_theta_step(model.structure, model.interface, 8e-3, 0.5, {});
  State state = state_of(model.structure, {0}, {0});
  test::run_steps(model, step, 75, state);
  CHECK(std::abs(gap_of(model.interface, state.u)) < 1e-13);
}

TEST_CASE("a sliding brick stops where and when Coulomb says")
{
  const double g = 9.81, mu = 0.3, v0 = 2, stop = v0 / (mu * g), h = 4e-3;
  test::SmallModel model;
  model.structure = test::make_structure(test::diagonal({3, 3}), test::zeros(2, 2), test::zeros(2, 2), {-3 * g, 0});
  model.interface = test::make_interface({{1, 0}, {0, 1}}, 1, {0}, {0}, mu, model.structure.K);
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, 0.5, {});
  State state = state_of(model.structure, {0, 0}, {0, v0});
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  double stopped = 0;
  for (int i = 0; i < 190; ++i)
  {
    const StepReport report = advance(step, model.structure, model.interface, work, state);
    if (report.stick == 1 && stopped == 0) stopped = state.time;
    if (stopped > 0) CHECK(report.stick == 1);
  }
  CHECK(std::abs(stopped - stop) <= h);
  CHECK(std::abs(all_entries(state.v)[1]) < 1e-12);
  // exact up to the step of the stop, which is travelled at half speed: at most (mu g h) h/8
  CHECK(std::abs(all_entries(state.u)[1] - v0 * stop / 2) < mu * g * h * h / 8 + 1e-10);
}

namespace
{

/// A mass on a belt, pressed with 2 N and held by springs along and across it: sliding, friction turns with its swing
/// across. Ends after a second, and what friction took beside what it brought; the work it should have taken is
/// h mu r_n |s_theta|.
std::vector<double> swung_across(int steps, double& worst)
{
  const double mu = 0.5, h = 1. / steps, theta = 0.5;
  const std::vector<double> belt = {1, 0};
  test::SmallModel model;
  model.structure =
      test::make_structure(test::diagonal({1, 1, 1}), test::zeros(3, 3), test::diagonal({1, 30, 50}), {-2, 0, 0});
  model.interface = test::make_interface({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 2, {0}, belt, mu, model.structure.K);
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, theta, {});
  State state = state_of(model.structure, {0, 0, 0.05}, {0, 0, 0.3});
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  worst = 0;
  for (int i = 0; i < steps; ++i)
  {
    const std::vector<double> before = all_entries(state.v);
    const StepReport report = advance(step, model.structure, model.interface, work, state);
    const std::vector<double> after = all_entries(state.v), &r = state.reactions;
    CHECK(report.slip == 1);
    double speed = 0, work_of_belt = 0;
    for (std::size_t k = 0; k < 2; ++k)
    {
      speed = std::hypot(speed, theta * after[k + 1] + (1 - theta) * before[k + 1] - belt[k]);
      work_of_belt += h * r[k + 1] * belt[k];
    }
    worst = std::max(worst, std::abs(report.contact_work - work_of_belt + h * mu * r[0] * speed));
  }
  return all_entries(state.u);
}

/// The error across the belt at n steps over that at twice as many, from the change on halving.
double error_ratio(int steps, double& worst)
{
  const double coarse = swung_across(steps, worst)[2], middle = swung_across(2 * steps, worst)[2],
               fine = swung_across(4 * steps, worst)[2];
  return std::abs((coarse - middle) / (middle - fine));
}

} // namespace

TEST_CASE("sliding is of second order where friction turns, and friction takes mu r_n |s_theta|")
{
  double worst = 0;
  CHECK(error_ratio(50, worst) == doctest::Approx(4).epsilon(0.05)); // the next order is h^2 of it, and the least phase
  CHECK(worst < 1e-14);
}

TEST_CASE("the energy identity holds in every step: lift-off, touch, stick and slip, any theta")
{
  for (const double theta : {0.5, 0.55, 1.})
  {
    const auto model = test::unilateral_oscillator(0.3, 0.6);
    const Structure& structure = model.structure;
    const double h = 0.05;
    const ThetaStep step = make_theta_step(structure, model.interface, h, theta, {});
    State state = state_of(structure, {-0.5, 1, -0.3}, {0.3, -0.2, 0.6});
    StepWork work = begin_steps(step, structure, model.interface, state);
    int open = 0, stick = 0, slip = 0;
    double worst = 0, worst_reported = 0;
    for (int i = 0; i < 180; ++i)
    {
      const State before = copy_of(state);
      const StepReport report = advance(step, structure, model.interface, work, state);
      open += report.open, stick += report.stick, slip += report.slip;
      // anew from the matrices: none of the step's own products
      const double change = kinetic_energy(structure, state.v) + potential_energy(structure, state.u) -
                            kinetic_energy(structure, before.v) - potential_energy(structure, before.u);
      const Owned<Vec> du = copy_of(state.u.get()), dv = copy_of(state.v.get()), v_theta = copy_of(state.v.get()),
                       force = copy_of(structure.load.get()), Cv = zeros_like(state.v);
      check(VecAXPY(du, -1, before.u));
      check(VecAXPY(dv, -1, before.v));
      check(VecAXPBY(v_theta, 1 - theta, theta, before.v));
      add_reactions(model.interface, state.reactions, force);
      check(MatMult(structure.C, v_theta, Cv));
      check(VecAXPY(force, -1, Cv));
      double work_done = 0;
      check(VecDot(v_theta, force, &work_done));
      const double scheme = (1 - 2 * theta) * (kinetic_energy(structure, dv) + potential_energy(structure, du));
      worst = std::max(worst, std::abs(change - scheme - h * work_done) / report.energy);
      worst_reported = std::max(worst_reported, std::abs(report.energy_defect) / report.energy);
    }
    CAPTURE(theta);
    CHECK(open * slip > 0);
    if (theta == 0.5) CHECK(stick > 0);
    CHECK(worst < 1e-12);
    CHECK(worst_reported < 1e-12);
  }
}

TEST_CASE("a mode grows in persistent sliding at its discrete rate, fitted over five periods")
{
  const auto model = test::unilateral_oscillator(0.3, 1);
  const Sliding sliding = persistent_sliding(model, at_three_tenths);
  CHECK(sliding.mode.lambda.real() == approx(0.024503265987, 1e-10));
  CHECK(sliding.mode.lambda.imag() == approx(1.059820289428, 1e-11));
  TransientSettings settings;
  settings.periods = 5.2;
  settings.steps_per_period = 50;
  const Trajectory run =
      integrate(test::view_of(model, sliding), &sliding.mode, settings, {}, mode_start(sliding, 0.05), nullptr);
  CHECK(run.outcome.kind == OutcomeKind::completed);
  CHECK(run.steps == 260);
  CHECK(run.history.open.back() + run.history.stick.back() == 0);
  CHECK(run.growth_rate_fit == approx(run.predicted.real(), 1e-6));
  CHECK(run.predicted.real() < sliding.mode.lambda.real() * 0.998); // what 50 steps a period lose is seen
  CHECK(run.energy_defect_max < 1e-12);
}

TEST_CASE("theta = .51 with 50 steps a period hides a weak instability, as predicted, and is refused")
{
  const double mu = 0.1766; // just above the critical 0.17649
  const auto model = test::unilateral_oscillator(mu, 1);
  const Sliding sliding = persistent_sliding(model, Complex(0, 1.06));
  const double sigma = sliding.mode.lambda.real(), omega = sliding.mode.lambda.imag();
  REQUIRE(sigma > 0);
  REQUIRE(sigma / omega < 0.0013);
  TransientSettings settings;
  settings.periods = 5;
  settings.steps_per_period = 50;
  settings.theta = 0.51;
  const Trajectory run =
      integrate(test::view_of(model, sliding), &sliding.mode, settings, {}, mode_start(sliding, 0.05), nullptr);
  CHECK(run.outcome.kind == OutcomeKind::refused);
  CHECK(run.outcome.reason.find("2 pi (theta - 1/2) omega/sigma") != std::string::npos);
  CHECK(run.steps == 0);

  // marched all the same, it decays at the discrete rate
  const ThetaStep step = make_theta_step(model.structure, model.interface, two_pi / (50 * omega), settings.theta, {});
  State state = mode_start(sliding, 0.05);
  History history;
  ModeAmplitude amplitude = follow(model.structure, sliding.equilibrium, sliding.mode);
  march(step, test::view_of(model, sliding), 260, state,
        {nullptr, history, [&](const State& now, const StepReport&, const StepWork& work) {
           observe(amplitude, now.time, work.Ku, work.Mv);
         }});
  const double predicted = discrete_eigenvalue(sliding.mode.lambda, 0.51, step.h).real();
  CHECK(predicted < 0);
  CHECK(growth_rate(amplitude, two_pi / omega) == approx(predicted, 1e-6));
}

TEST_CASE("between events the trajectory converges with the square of the step")
{
  const auto model = test::unilateral_oscillator(0.3, 1);
  const Sliding sliding = persistent_sliding(model, at_three_tenths);
  const double time = 10, q = 0.1;
  const Complex end = q * std::exp(sliding.mode.lambda * time);
  const auto error = [&](int steps)
  {
    const ThetaStep step = make_theta_step(model.structure, model.interface, time / steps, 0.5, {});
    State state = mode_start(sliding, q);
    test::run_steps(model, step, steps, state);
    Owned<Vec> difference = copy_of(state.u.get());
    check(VecAXPY(difference, -1, sliding.equilibrium.u));
    check(VecAXPY(difference, -end.real(), sliding.mode.real));
    check(VecAXPY(difference, end.imag(), sliding.mode.imaginary));
    double norm = 0;
    check(VecNorm(difference, NORM_2, &norm));
    return norm;
  };
  CHECK(error(50) / error(100) == doctest::Approx(4).epsilon(0.02));
}

TEST_CASE("the two contact solvers give one trajectory")
{
  const auto model = test::unilateral_oscillator(0.3, 0.6);
  const auto end = [&](ContactSolver solver)
  {
    StepOptions options;
    options.contact.solver = solver;
    const ThetaStep step = make_theta_step(model.structure, model.interface, 0.03, 0.5, options);
    State state = state_of(model.structure, {-0.5, 1, -0.3}, {0.3, -0.2, 0.6});
    CHECK(test::run_steps(model, step, 200, state) == 0);
    return all_entries(state.u);
  };
  const auto a = end(ContactSolver::gauss_seidel), b = end(ContactSolver::fixed_point);
  for (std::size_t i = 0; i < 3; ++i) CHECK(std::abs(a[i] - b[i]) < 1e-8); // contact tolerance, piled up
}

TEST_CASE("contact that does not converge is an outcome, not a crash")
{
  StepOptions options;
  options.contact = {ContactSolver::fixed_point, 1e-300, 1, 0};
  const auto model = test::unilateral_oscillator(0.3, 0.6);
  const Sliding sliding = persistent_sliding(model, at_three_tenths);
  TransientSettings settings;
  settings.steps = 20;
  settings.step_size = 0.05;
  const Trajectory run =
      integrate(test::view_of(model, sliding), nullptr, settings, options, mode_start(sliding, 0.05), nullptr);
  CHECK(run.outcome.kind == OutcomeKind::not_converged);
  CHECK(run.outcome.reason.find("first at t = ") != std::string::npos);
  CHECK(run.steps == 20);
  CHECK(std::isnan(run.growth_rate_fit));
}
