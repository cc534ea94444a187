#pragma once
/// Checks of steps that hold for any law and any part of the matrices.
#include "oscillator_mode.hpp"
#include "squeal/transient/theta_step.hpp"

namespace squeal::test
{

inline StepOptions tight_contact()
{
  StepOptions options;
  options.contact.tolerance = 1e-14;
  return options;
}

/// A small motion about sliding, in the plane of a mode of one pair, follows u+ - 2 Re(z) u + |z|^2 u- = 0 with the
/// discrete eigenvalue ln(z)/h, and energy closes.
inline void check_discrete_motion(const SmallModel& model, const Equilibrium& equilibrium, const ComplexMode& mode,
                                  double theta)
{
  const double h = 0.05;
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, theta, tight_contact());
  const Complex z = std::exp(h * discrete_eigenvalue(mode.lambda, theta, h));
  State state = mode_state(equilibrium, mode, 1e-4, 0.3);
  const std::vector<double> rest = all_entries(equilibrium.u);
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  std::vector<std::vector<double>> u = {all_entries(state.u)};
  for (int i = 0; i < 40; ++i)
  {
    const StepReport report = advance(step, model.structure, model.interface, work, state);
    REQUIRE(report.slip == 1);
    CHECK(std::abs(report.energy_defect) < 1e-14);
    u.push_back(all_entries(state.u));
    if (i < 1) continue;
    const std::size_t last = u.size() - 1;
    for (std::size_t k = 0; k < rest.size(); ++k)
      CHECK(std::abs(u[last][k] - rest[k] - 2 * z.real() * (u[last - 1][k] - rest[k]) +
                     std::norm(z) * (u[last - 2][k] - rest[k])) < 1e-12); // rounding of displacements of 1
  }
}

/// A start (u, v), and a change of each that a column follows.
struct TangentCase
{
  std::vector<double> u, v, du, dv;
  double h = 0.04;
  int steps = 150;
};

inline std::vector<double> end_of(const SmallModel& model, const TangentCase& start, const std::array<double, 2>& d)
{
  const ThetaStep step = make_theta_step(model.structure, model.interface, start.h, 0.5, tight_contact());
  std::vector<double> u = start.u, v = start.v;
  for (std::size_t i = 0; i < u.size(); ++i)
  {
    u[i] += d[0] * start.du[i];
    v[i] += d[1] * start.dv[i];
  }
  State state = state_of(model.structure, u, v);
  CHECK(run_steps(model, step, start.steps, state) == 0);
  std::vector<double> end = all_entries(state.u);
  for (const double rate : all_entries(state.v)) end.push_back(rate);
  return end;
}

/// The tangent in u and v is the central difference quotient of the steps.
inline void check_tangent(const SmallModel& model, const TangentCase& start)
{
  const ThetaStep step = make_theta_step(model.structure, model.interface, start.h, 0.5, tight_contact());
  State state = state_of(model.structure, start.u, start.v);
  std::vector<StepRecord> records(static_cast<std::size_t>(start.steps));
  take_steps(step, model.structure, model.interface, state, start.steps, {records});
  const std::vector<double> nothing(start.u.size(), 0.);
  const Mat K = model.structure.K;
  std::vector<TangentColumn> columns(2);
  for (std::size_t k = 0; k < 2; ++k)
    columns[k] = {vector_like(K, k == 0 ? start.du : nothing), vector_like(K, k == 1 ? start.dv : nothing)};
  advance_tangents(step, model.structure, model.interface, records, columns);
  for (std::size_t k = 0; k < 2; ++k)
  {
    const double e = 1e-6;
    std::array<double, 2> up{}, down{};
    up[k] = e;
    down[k] = -e;
    const std::vector<double> above = end_of(model, start, up), below = end_of(model, start, down);
    std::vector<double> found = all_entries(columns[k].u);
    for (const double entry : all_entries(columns[k].v)) found.push_back(entry);
    for (std::size_t i = 0; i < found.size();
         ++i) // rounding 1e-13/e and curvature e^2, times the growth over the steps
      CHECK(std::abs(found[i] - (above[i] - below[i]) / (2 * e)) < 1e-6);
  }
}

} // namespace squeal::test
