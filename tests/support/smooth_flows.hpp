#pragma once
/// Smooth oscillators with known periodic orbits, as flows for shooting. All their entries are on rank 0.
#include "squeal/shooting/flow.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

namespace squeal::test
{

/// A vector of `values`, all on rank 0.
inline Owned<Vec> on_first_rank(const std::vector<double>& values)
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

inline Owned<Mat> diagonal_matrix(Vec entries)
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

inline std::vector<double> gather(Vec state)
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

inline void scatter(const std::vector<double>& x, Vec state)
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

/// Classical Runge-Kutta over a time.
inline void run(int steps, double time, const Rate& rate_of, std::vector<double>& x)
{
  const double h = time / steps;
  std::vector<double> k(x.size()), sum(x.size()), at(x.size());
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
}

/// The rate of (x, y), y a small change of x: its derivative along y by a central difference, good to 1e-9.
inline Rate with_tangent(const Rate& rate_of)
{
  return [rate_of](const std::vector<double>& both, std::vector<double>& rate)
  {
    const auto size = both.size() / 2;
    double length = 0;
    for (std::size_t i = 0; i < size; ++i) length = std::max(length, std::abs(both[size + i]));
    const double step = 1e-6 / std::max(length, 1e-300);
    std::vector<double> x(both.begin(), both.begin() + static_cast<std::ptrdiff_t>(size)), ahead = x, behind = x, k;
    for (std::size_t i = 0; i < size; ++i)
    {
      ahead[i] += step * both[size + i];
      behind[i] -= step * both[size + i];
    }
    rate_of(x, rate);
    rate_of(ahead, k);
    rate_of(behind, x);
    for (std::size_t i = 0; i < size; ++i) rate.push_back((k[i] - x[i]) / (2 * step));
  };
}

/// Gives the flow the tangent of Runge-Kutta in a number of steps a period.
inline void add_tangent(Flow& flow, int steps, const Rate& rate_of)
{
  struct Recorded
  {
    double period = 0;
    int steps = 0;
    std::vector<double> start{};
  };
  const auto recorded = std::make_shared<Recorded>();
  flow.record_period = [recorded, steps](double period, Vec start, const TimeGrid& grid) {
    *recorded = {period, grid.steps(steps), gather(start)};
  };
  flow.apply_tangent = [recorded, both_of = with_tangent(rate_of)](std::span<const Vec> states)
  {
    for (const Vec state : states)
    {
      std::vector<double> both = recorded->start;
      const std::vector<double> change = gather(state);
      both.insert(both.end(), change.begin(), change.end());
      run(recorded->steps, recorded->period, both_of, both);
      both.erase(both.begin(), both.begin() + static_cast<std::ptrdiff_t>(change.size()));
      scatter(both, state);
    }
  };
}

/// Classical Runge-Kutta in a number of steps a call.
inline Flow runge_kutta_in(int steps, Rate rate_of, Mat M, Mat K)
{
  const auto integrate = [rate_of, steps](double period, Vec start, Vec end, Vec rate)
  {
    std::vector<double> x = gather(start), k(x.size());
    run(steps, period, rate_of, x);
    scatter(x, end);
    if (!rate) return;
    if (!x.empty()) rate_of(x, k);
    scatter(k, rate);
  };
  return {integrate, M, K};
}

/// 2000 steps a period: a period error of about 1e-12, below every tolerance here.
inline Flow runge_kutta(Rate rate_of, Mat M, Mat K)
{
  return runge_kutta_in(2000, std::move(rate_of), M, K);
}

inline void van_der_pol(const std::vector<double>& x, std::vector<double>& rate)
{
  rate = {x[1], (1 - x[0] * x[0]) * x[1] - x[0]};
}

/// Two van der Pol oscillators that damp each other: two cycles, of one oscillator each.
inline void coupled(const std::vector<double>& x, std::vector<double>& rate)
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

inline SmoothModel make_smooth_model(const Rate& rate, const std::vector<double>& stiffness)
{
  SmoothModel model;
  model.stiffness = on_first_rank(stiffness);
  model.zero = zeros_like(model.stiffness);
  const Owned<Vec> ones = zeros_like(model.stiffness);
  check(VecSet(ones, 1));
  model.M = diagonal_matrix(ones);
  model.K = diagonal_matrix(model.stiffness);
  for (std::size_t i = 0; i < stiffness.size(); ++i)
  {
    std::vector<double> axis(stiffness.size(), 0.);
    axis[i] = 1;
    model.axes.push_back(on_first_rank(axis));
  }
  model.flow = runge_kutta(rate, model.M, model.K);
  add_tangent(model.flow, 2000, rate);
  return model;
}

// Reference values to 20 digits from the literature of the equation x'' - (1 - x^2) x' + x = 0.
inline constexpr double vdp_period = 6.6632868593231302, vdp_amplitude = 2.0086198608748431,
                        vdp_multiplier = 8.5969506e-4;

} // namespace squeal::test
