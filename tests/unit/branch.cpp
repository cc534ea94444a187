// Continuation on smooth oscillators whose branches are known exactly; it knows no brake.
#include "../support/smooth_flows.hpp"
#include "squeal/branch/continuation.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <memory>
#include <numbers>

using namespace squeal;
using namespace squeal::test;

namespace
{

constexpr double pi = std::numbers::pi;

/// A right-hand side with a parameter.
using FamilyRate = std::function<void(double parameter, const std::vector<double>& x, std::vector<double>& rate)>;

struct SmoothFamily
{
  double parameter = 0, period = 0;
  double moved = 0; // what the tangent adds to the parameter
  SmoothModel model;
  Owned<Vec> recorded{};
  FlowFamily family{};
};

/// (end of start + step change) - (end of start - step change), over 2 step
void central_difference(const Flow& flow, double period, Vec start, Vec change)
{
  const double step = 1e-5; // rounding over the step, and its square times third derivatives: below 1e-9
  const Owned<Vec> ahead = zeros_like(start), behind = zeros_like(start), end = zeros_like(start);
  check(VecWAXPY(ahead, step, change, start));
  check(VecWAXPY(behind, -step, change, start));
  flow.integrate(period, ahead, change, nullptr);
  flow.integrate(period, behind, end, nullptr);
  check(VecAXPBY(change, -0.5 / step, 0.5 / step, end));
}

/// The flows of the rate at all parameters, with tangent and column by central differences.
std::unique_ptr<SmoothFamily> family_of(const FamilyRate& rate_of, const std::vector<double>& stiffness)
{
  auto made = std::make_unique<SmoothFamily>();
  SmoothFamily* const self = made.get();
  made->model = make_smooth_model([self, rate_of](const std::vector<double>& x, std::vector<double>& rate)
                                  { rate_of(self->parameter, x, rate); },
                                  stiffness);
  FlowFamily& family = made->family;
  family.flow = made->model.flow;
  family.set_parameter = [self](double parameter) { self->parameter = parameter; };
  family.rest = [self] { return state_of(self->model.zero, self->model.zero); };
  family.flow.record_period = [self](double period, Vec start, const TimeGrid&)
  {
    self->period = period;
    self->recorded = copy_of(start);
  };
  family.flow.apply_tangent = [self](std::span<const Vec> states)
  {
    const double parameter = self->parameter;
    self->parameter += self->moved;
    for (const Vec state : states) central_difference(self->model.flow, self->period, self->recorded, state);
    self->parameter = parameter;
  };
  family.parameter_column = [self](double period, Vec start, Vec column)
  {
    const double parameter = self->parameter, step = 1e-5;
    const Owned<Vec> behind = zeros_like(column);
    self->parameter = parameter + step;
    self->model.flow.integrate(period, start, column, nullptr);
    self->parameter = parameter - step;
    self->model.flow.integrate(period, start, behind, nullptr);
    self->parameter = parameter;
    check(VecAXPBY(column, -0.5 / step, 0.5 / step, behind));
  };
  return made;
}

Branch branch_from(const SmoothFamily& made, const std::vector<double>& u, double period, double parameter,
                   const ContinuationSettings& settings)
{
  made.family.set_parameter(parameter);
  const Owned<Vec> start = on_first_rank(u);
  Progress progress(PETSC_COMM_WORLD, "test", 1);
  ConvergenceLog log{progress};
  const OrbitProblem problem{made.family.flow, made.family.preconditioner, state_of(made.model.zero, made.model.zero),
                             period,           settings.tolerance,         0};
  const Orbit orbit = evaluate(problem, log, state_of(start, made.model.zero), period);
  REQUIRE(orbit.residual < settings.tolerance);
  return trace_branch(made.family, settings, {}, orbit, parameter);
}

/// x'' + x = x' (p + r^2 - r^4), r^2 = x^2 + x'^2: circles of radius r with p = r^4 - r^2, period 2 pi and the
/// multiplier exp(2 pi r^2 (1 - 2 r^2)). Hopf at p = 0, fold at p = -1/4.
void subcritical(double p, const std::vector<double>& x, std::vector<double>& rate)
{
  const double square = x[0] * x[0] + x[1] * x[1];
  rate = {x[1], (p + square - square * square) * x[1] - x[0]};
}

/// A circle of radius 1, and beside it y'' + 3 y = p y': a Neimark-Sacker point at p = 0.
void with_bystander(double p, const std::vector<double>& x, std::vector<double>& rate)
{
  rate = {x[2], x[3], (1 - x[0] * x[0] - x[2] * x[2]) * x[2] - x[0], p * x[3] - 3 * x[1]};
}

/// A circle of radius 1, and beside it y'' + 3 y = p y'/20, whose multipliers have the modulus exp(pi p/20).
void with_slow_bystander(double p, const std::vector<double>& x, std::vector<double>& rate)
{
  with_bystander(p / 20, x, rate);
}

/// A circle of radius 1, and beside it y'' + p y = y'/5: above p = 1/100 its multipliers are complex, below real, and
/// beyond the unit circle on either side.
void with_meeting_bystander(double p, const std::vector<double>& x, std::vector<double>& rate)
{
  rate = {x[2], x[3], (1 - x[0] * x[0] - x[2] * x[2]) * x[2] - x[0], x[3] / 5 - p * x[1]};
}

const BranchEvent* event_of(const Branch& branch, BranchEventKind kind)
{
  const auto found = std::find_if(branch.events.begin(), branch.events.end(),
                                  [kind](const BranchEvent& event) { return event.kind == kind; });
  return found == branch.events.end() ? nullptr : &*found;
}

} // namespace

TEST_CASE("a branch is followed round its fold down to its Hopf point, every point on the exact curve")
{
  const auto made = family_of(subcritical, {1});
  const double radius = std::sqrt((1 + std::sqrt(3.)) / 2); // p = 1/2
  const Branch branch = branch_from(*made, {radius}, 2 * pi, 0.5, {-0.6, 0.5, 30, 1e-9});
  CHECK(branch.ends.forward == BranchEnding::not_followed);
  CHECK(branch.ends.backward == BranchEnding::small_amplitude);
  REQUIRE(branch.points.size() > 20);
  for (const BranchPoint& point : branch.points)
  {
    // |x|^2 is r^2 at stiffness and mass 1; the residual of 1e-9 counts 1/|1 - m|-fold, which the fold makes large
    const double square = point.orbit.fluctuation * point.orbit.fluctuation,
                 m = std::exp(2 * pi * square * (1 - 2 * square));
    CHECK(point.parameter == doctest::Approx(square * square - square).epsilon(1e-7));
    CHECK(point.orbit.period == doctest::Approx(2 * pi).epsilon(1e-8));
    REQUIRE(point.multipliers.values.size() == 1);
    // along eight periods a motion leaves an orbit that repels, by m^8 of its residual
    CHECK(std::abs(point.multipliers.values[0] - m) <= std::max(1e-5, point.multipliers.errors[0]));
    CHECK(point.multipliers.errors[0] < 1e-3);
    if (std::abs(m - 1) > 1e-3) CHECK(point.multipliers.stability == (m < 1 ? Stability::stable : Stability::unstable));
  }
  const BranchEvent* fold = event_of(branch, BranchEventKind::fold);
  REQUIRE(fold);
  CHECK(std::abs(fold->parameter + 0.25) < 1e-5);
  CHECK(std::abs(fold->parameter + 0.25) < fold->error);
  const BranchEvent* hopf = event_of(branch, BranchEventKind::hopf);
  REQUIRE(hopf);
  CHECK(std::abs(hopf->parameter) < 1e-6);
  CHECK(hopf->period == doctest::Approx(2 * pi).epsilon(1e-6));
}

TEST_CASE("a Neimark-Sacker point is located within its error, and both bounds are reached")
{
  const auto made = family_of(with_bystander, {1, 3});
  const Branch branch = branch_from(*made, {1, 0}, 2 * pi, -0.07, {-0.1, 0.1, 10, 1e-9});
  CHECK(branch.ends.forward == BranchEnding::bound);
  CHECK(branch.ends.backward == BranchEnding::bound);
  CHECK(branch.points.front().parameter == -0.1);
  CHECK(branch.points.back().parameter == 0.1);
  const BranchEvent* passed = event_of(branch, BranchEventKind::neimark_sacker);
  REQUIRE(passed);
  CHECK(branch.events.size() == 1);
  CHECK(passed->change == 1);
  CHECK(std::abs(passed->parameter) <= passed->error);
  CHECK(passed->error < 1e-3);
}

TEST_CASE("bars that reach across the unit circle at some points make up no event")
{
  const auto made = family_of(with_slow_bystander, {1, 3});
  SmoothFamily* const self = made.get();
  made->family.flow.record_period = [self](double period, Vec start, const TimeGrid& grid)
  {
    self->period = period;
    self->recorded = copy_of(start);
    // a bar is what a shift changes: here what 1/20 of p does, in every other interval of a length of 1/500
    self->moved = grid.shift > 0 && static_cast<long>(std::floor(500 * self->parameter)) % 2 == 0 ? 0.05 : 0;
  };
  const Branch branch = branch_from(*made, {1, 0}, 2 * pi, -0.07, {-0.1, 0.1, 40, 1e-9});
  CHECK(branch.points.back().parameter == 0.1);
  int flickers = 0; // points whose bars reach across among points whose bars do not
  for (std::size_t i = 1; i < branch.points.size(); ++i)
    flickers += branch.points[i].parameter > 0.01 && branch.points[i].parameter < 0.05 &&
                branch.points[i].multipliers.stability != branch.points[i - 1].multipliers.stability;
  CHECK(flickers >= 1);
  REQUIRE(branch.events.size() == 1);
  CHECK(branch.events[0].kind == BranchEventKind::neimark_sacker);
  CHECK(branch.events[0].change == 1);
  CHECK(std::abs(branch.events[0].parameter) <= branch.events[0].error);
  CHECK(std::abs(branch.events[0].parameter) < 1e-3); // its value passes 1 there, whatever the bars
}

TEST_CASE("multipliers that meet on the real axis beyond the unit circle are no event")
{
  const auto made = family_of(with_meeting_bystander, {1, 3});
  const Branch branch = branch_from(*made, {1, 0}, 2 * pi, 0.015, {0.005, 0.02, 5, 1e-9});
  CHECK(branch.points.front().parameter == 0.005);
  CHECK(branch.points.front().multipliers.values[0].imag() == 0);
  CHECK(branch.points.back().multipliers.values[0].imag() != 0);
  CHECK(branch.events.empty());
}

TEST_CASE("both bounds of a range are reached exactly, and no event is made up between")
{
  const auto made = family_of(subcritical, {1});
  const double radius = std::sqrt((1 + std::sqrt(3.)) / 2);
  const Branch branch = branch_from(*made, {radius}, 2 * pi, 0.5, {-0.2, 0.6, 20, 1e-9});
  CHECK(branch.ends.backward == BranchEnding::bound);
  CHECK(branch.ends.forward == BranchEnding::bound);
  CHECK(branch.points.front().parameter == -0.2);
  CHECK(branch.points.back().parameter == 0.6);
  CHECK(branch.events.empty());
}

TEST_CASE("a branch that breaks off says so, and where")
{
  // circles of radius 1 + sqrt(p): no flow below p = 0
  const auto broken = [](double p, const std::vector<double>& x, std::vector<double>& rate) {
    rate = {x[1], (1 + std::sqrt(p) - std::hypot(x[0], x[1])) * x[1] - x[0]};
  };
  const auto made = family_of(broken, {1});
  const Branch branch = branch_from(*made, {1.5}, 2 * pi, 0.25, {-0.1, 0.3, 20, 1e-9});
  CHECK(branch.ends.backward == BranchEnding::step_too_small);
  CHECK(branch.ends.forward == BranchEnding::bound);
  CHECK(branch.points.front().parameter > 0);
  CHECK(branch.points.front().parameter < 0.02); // a step spans 0.4/20
}
