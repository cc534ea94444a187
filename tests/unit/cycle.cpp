#include "../support/option.hpp"
#include "squeal/shooting/shooting.hpp"

#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using test::Option;

namespace
{

/// A vector of `values`, all on rank 0.
Owned<Vec> on_first_rank(const std::vector<double>& values)
{
  const bool mine = rank_of(PETSC_COMM_WORLD) == 0;
  const PetscInt size = static_cast<PetscInt>(values.size());
  Owned<Vec> result;
  check(VecCreateMPI(PETSC_COMM_WORLD, mine ? size : 0, size, result.put()));
  for (PetscInt i = 0; mine && i < size; ++i)
    check(VecSetValue(result, i, values[static_cast<std::size_t>(i)], INSERT_VALUES));
  check(VecAssemblyBegin(result));
  check(VecAssemblyEnd(result));
  return result;
}

Owned<Mat> diagonal(Vec entries)
{
  PetscInt local = 0;
  check(VecGetLocalSize(entries, &local));
  Owned<Mat> result;
  check(MatCreateAIJ(PETSC_COMM_WORLD, local, local, PETSC_DETERMINE, PETSC_DETERMINE, 1, nullptr, 0, nullptr,
                     result.put()));
  check(MatDiagonalSet(result, entries, INSERT_VALUES));
  check(MatAssemblyBegin(result, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(result, MAT_FINAL_ASSEMBLY));
  return result;
}

using Rate = std::function<void(const std::vector<double>& x, std::vector<double>& rate)>; // x = (u, v)

std::vector<double> gather(Vec state)
{
  std::vector<double> x;
  for (const Vec part : {displacement(state), velocity(state)})
  {
    const double* entries = nullptr;
    PetscInt size = 0;
    check(VecGetLocalSize(part, &size));
    check(VecGetArrayRead(part, &entries));
    x.insert(x.end(), entries, entries + size);
    check(VecRestoreArrayRead(part, &entries));
  }
  return x;
}

void scatter(const std::vector<double>& x, Vec state)
{
  std::size_t next = 0;
  for (const Vec part : {displacement(state), velocity(state)})
  {
    double* entries = nullptr;
    PetscInt size = 0;
    check(VecGetLocalSize(part, &size));
    check(VecGetArray(part, &entries));
    for (PetscInt i = 0; i < size; ++i) entries[i] = x[next++];
    check(VecRestoreArray(part, &entries));
  }
}

/// Classical Runge-Kutta, 2000 steps a period: a period error of about 1e-12, below every tolerance here.
Flow runge_kutta(Rate rate_of, Mat M, Mat K)
{
  const auto integrate = [rate_of](double period, Vec start, Vec end, Vec rate)
  {
    const int steps = 2000;
    const double h = period / steps;
    std::vector<double> x = gather(start), k(x.size()), sum(x.size()), at(x.size());
    for (int step = 0; step < steps && !x.empty(); ++step)
    {
      sum.assign(x.size(), 0);
      at = x;
      for (int stage = 0; stage < 4; ++stage)
      {
        rate_of(at, k);
        const double weight = stage == 0 || stage == 3 ? h / 6 : h / 3, ahead = stage == 2 ? h : h / 2;
        for (std::size_t i = 0; i < x.size(); ++i)
        {
          sum[i] += weight * k[i];
          at[i] = x[i] + ahead * k[i];
        }
      }
      for (std::size_t i = 0; i < x.size(); ++i) x[i] += sum[i];
    }
    scatter(x, end);
    if (!rate) return;
    if (!x.empty()) rate_of(x, k);
    scatter(k, rate);
  };
  return {integrate, M, K};
}

void van_der_pol(const std::vector<double>& x, std::vector<double>& rate)
{
  rate = {x[1], (1 - x[0] * x[0]) * x[1] - x[0]};
}

/// Two van der Pol oscillators that damp each other: two cycles, of one oscillator each.
void coupled(const std::vector<double>& x, std::vector<double>& rate)
{
  rate = {x[2], x[3], 0.1 * (1 - x[0] * x[0] - x[1] * x[1]) * x[2] - x[0],
          0.1 * (1 - x[1] * x[1] - x[0] * x[0]) * x[3] - 2 * x[1]};
}

struct SmoothModel
{
  Owned<Vec> zero, stiffness;
  std::vector<Owned<Vec>> axes;
  Owned<Mat> M, K;
  Flow flow;
};

SmoothModel make_model(const Rate& rate, const std::vector<double>& stiffness)
{
  SmoothModel model;
  model.stiffness = on_first_rank(stiffness);
  model.zero = zeros_like(model.stiffness);
  const Owned<Vec> ones = zeros_like(model.stiffness);
  check(VecSet(ones, 1));
  model.M = diagonal(ones);
  model.K = diagonal(model.stiffness);
  for (std::size_t i = 0; i < stiffness.size(); ++i)
  {
    std::vector<double> axis(stiffness.size(), 0.);
    axis[i] = 1;
    model.axes.push_back(on_first_rank(axis));
  }
  model.flow = runge_kutta(rate, model.M, model.K);
  return model;
}

LimitCycle shoot_from(const SmoothModel& model, const std::vector<double>& u, double period, int free)
{
  const Owned<Vec> start = on_first_rank(u);
  ShootingStart at{model.zero, start, model.zero, period, {}};
  for (const auto& axis : model.axes) at.shapes.push_back(axis);
  return shoot(model.flow, at, {}, 1e-9, free);
}

// Reference values to 20 digits from the literature of the equation x'' - (1 - x^2) x' + x = 0.
constexpr double vdp_period = 6.6632868593231302, vdp_amplitude = 2.0086198608748431, vdp_multiplier = 8.5969506e-4;

double largest_amplitude(const SmoothModel& model, const LimitCycle& cycle)
{
  // x is extreme where v = 0: a short way along the cycle is integrated until v changes sign
  Owned<Vec> state = state_of(cycle.start.u, cycle.start.v), end = zeros_like(state);
  double largest = 0;
  for (int i = 0; i < 400; ++i)
  {
    model.flow.integrate(cycle.period / 400, state, end, nullptr);
    std::swap(state, end);
    double x = 0;
    check(VecNorm(displacement(state), NORM_INFINITY, &x));
    largest = std::max(largest, x);
  }
  return largest;
}

} // namespace

TEST_CASE("reduced shooting spans a one-degree system and finds the van der Pol cycle")
{
  const SmoothModel model = make_model(van_der_pol, {1});
  const Option finish("-cycle_finish", "none");
  const LimitCycle cycle = shoot_from(model, {1.5}, 6.3, 0);
  CHECK(cycle.outcome.kind == OutcomeKind::converged);
  CHECK(cycle.period == doctest::Approx(vdp_period).epsilon(1e-8));
  // 400 samples of a parabola at its top miss at most (pi/400)^2 of it
  CHECK(largest_amplitude(model, cycle) == doctest::Approx(vdp_amplitude).epsilon(1e-4));
  CHECK(cycle.records.back().unknowns == 3);
  CHECK(cycle.residual_projected < 1e-9);
  CHECK(cycle.periods_integrated > cycle.newton_iterations);
}

TEST_CASE("multipliers of the van der Pol cycle: one, and a strong contraction")
{
  const SmoothModel model = make_model(van_der_pol, {1});
  const LimitCycle cycle = shoot_from(model, {1.5}, 6.3, 2);
  REQUIRE(cycle.multipliers.size() == 1); // the shift in time is told apart
  // difference quotients with a step of 1e-6 are good to about that
  CHECK(cycle.trivial_error < 1e-5);
  CHECK(std::abs(cycle.multipliers[0] - vdp_multiplier) < 1e-5);
  CHECK(cycle.stability == "stable");
  CHECK(cycle.multiplier_periods == 2);
}

TEST_CASE("the full-space finishes agree with each other and with the reference")
{
  const SmoothModel model = make_model(van_der_pol, {1});
  const Option reduced("-cycle_reduced_newtons", "0");
  for (const char* method : {"multisecant", "newton_krylov"})
  {
    CAPTURE(method);
    const Option finish("-cycle_finish", method);
    const LimitCycle cycle = shoot_from(model, {1.5}, 6.3, 2);
    CHECK(cycle.outcome.kind == OutcomeKind::converged);
    CHECK(cycle.residual_full < 1e-9);
    CHECK(cycle.period == doctest::Approx(vdp_period).epsilon(1e-8));
    CHECK(cycle.records.back().stage == (method == std::string("multisecant") ? "multisecant" : "newton-krylov"));
  }
}

TEST_CASE("of two coexisting cycles the start decides")
{
  const SmoothModel model = make_model(coupled, {1, 2});
  const LimitCycle first = shoot_from(model, {1.8, 0.2}, 6.3, 10);
  CHECK(first.outcome.kind == OutcomeKind::converged);
  CHECK(first.period == doctest::Approx(6.287111272289).epsilon(1e-8));
  CHECK(first.stability == "stable");
  const LimitCycle second = shoot_from(model, {0.2, 1.8}, 4.44, 10);
  CHECK(second.outcome.kind == OutcomeKind::converged);
  CHECK(second.period == doctest::Approx(4.444271158025).epsilon(1e-8));
}

TEST_CASE("a decaying oscillation has no cycle: collapsed, not converged")
{
  const auto damped = [](const std::vector<double>& x, std::vector<double>& rate) {
    rate = {x[1], -0.1 * x[1] - x[0]};
  };
  const SmoothModel model = make_model(damped, {1});
  const LimitCycle cycle = shoot_from(model, {1}, 6.3, 2);
  CHECK(cycle.outcome.kind == OutcomeKind::collapsed_to_equilibrium);
}

TEST_CASE("a cycle that repels is no result: van der Pol in reversed time has no other")
{
  const auto reversed = [](const std::vector<double>& x, std::vector<double>& rate) {
    rate = {x[1], -(1 - x[0] * x[0]) * x[1] - x[0]};
  };
  const SmoothModel model = make_model(reversed, {1});
  const LimitCycle cycle = shoot_from(model, {vdp_amplitude}, vdp_period, 0);
  CHECK(cycle.residual_full < 1e-9);
  CHECK(cycle.outcome.kind == OutcomeKind::unstable_cycle);
  CHECK(cycle.outcome.reason.find("repels") != std::string::npos);
  CHECK(cycle.stability == "unstable");
  REQUIRE(cycle.multipliers.size() == 1);
  // the reciprocal of the attracting one; a difference of 1e-6 bends by the multiplier's own thousandfold growth
  CHECK(cycle.multipliers[0].real() == doctest::Approx(1 / vdp_multiplier).epsilon(0.02));
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
  const SmoothModel model = make_model(rate_of, {1});
  const LimitCycle cycle = shoot_from(model, {1}, 6.28, 0);
  CHECK(cycle.outcome.kind == OutcomeKind::converged);
  CHECK(cycle.stability == "stable");
  CHECK(largest_amplitude(model, cycle) == doctest::Approx(2).epsilon(0.01)); // first order in d
  // the one that repels was met first
  const auto met = std::count_if(cycle.records.begin(), cycle.records.end(),
                                 [](const NewtonRecord& entry) { return entry.residual_full < 1e-9; });
  CHECK(met >= 2);
}

TEST_CASE("dependent vectors do not enter the base")
{
  const SmoothModel model = make_model(coupled, {1, 2});
  const Preconditioner none;
  const ShootingOptions options;
  Shooting shooting{model.flow, none, options};
  std::vector<Owned<Vec>> base;
  const Owned<Vec> a = state_of(model.axes[0], model.zero), b = state_of(model.axes[1], model.zero);
  extend_base(shooting, base, a);
  extend_base(shooting, base, b);
  const Owned<Vec> both = copy_of(a.get());
  check(VecAXPY(both, -3, b));
  extend_base(shooting, base, both);
  REQUIRE(base.size() == 2);
  CHECK(std::abs(energy_product(model.flow, base[0], base[1])) < 1e-14);
  CHECK(energy_norm(model.flow, base[1]) == doctest::Approx(1).epsilon(1e-14));
}
