#pragma once
/// The followed mode of the unilateral oscillator, from its own three equations, and states that start on it.
#include "sliding_oscillator.hpp"
#include "squeal/transient/transient.hpp"

#include <cmath>
#include <doctest/doctest.h>

namespace squeal::test
{

using Complex = std::complex<double>;

inline State state_of(const Structure& structure, const std::vector<double>& u, const std::vector<double>& v)
{
  return {vector_like(structure.K, u), vector_like(structure.K, v), 0, {}};
}

/// `steps` steps in place; how many of them did not converge.
inline int run_steps(const SmallModel& model, const ThetaStep& step, int steps, State& state)
{
  StepWork work = begin_steps(step, model.structure, model.interface, state);
  int unconverged = 0;
  for (int i = 0; i < steps; ++i)
    if (!advance(step, model.structure, model.interface, work, state).contact_converged) ++unconverged;
  return unconverged;
}

/// The oscillator's eigenvalue of persistent sliding, its mode and its equilibrium, from its own three equations.
struct Sliding
{
  Equilibrium equilibrium;
  ComplexMode mode;
};

inline Sliding persistent_sliding(const SmallModel& model, Complex guess)
{
  const Structure& structure = model.structure;
  const double mu = model.interface.friction.common.coefficient;
  // y = y1 = y2 = 1: r = -(0.5 l^2 + 0.02 l + 1.2), (l^2 + 0.02 l + 1.1) x = 0.1 + mu r, and the pad's own
  // -0.1 x + l^2 + 0.02 l + 0.5 - r = 0
  const auto x_of = [&](Complex l) { return (0.1 - mu * (0.5 * l * l + 0.02 * l + 1.2)) / (l * l + 0.02 * l + 1.1); };
  const auto defect = [&](Complex l) { return -0.1 * x_of(l) + 1.5 * l * l + 0.04 * l + 1.7; };
  Complex l = guess;
  for (int i = 0; i < 50; ++i)
  {
    const Complex d(1e-6, 0);
    l -= defect(l) * 2. * d / (defect(l + d) - defect(l - d));
  }
  REQUIRE(std::abs(defect(l)) < 1e-13);
  Sliding sliding;
  const Complex x = x_of(l);
  const double scale = std::max(1., std::abs(x));
  sliding.mode.lambda = l;
  sliding.mode.real = vector_like(structure.K, {x.real() / scale, 1 / scale, 1 / scale});
  sliding.mode.imaginary = vector_like(structure.K, {x.imag() / scale, 0, 0});
  sliding.equilibrium = sliding_equilibrium(model);
  return sliding;
}

inline SlidingEquilibrium view_of(const SmallModel& model, const Sliding& sliding)
{
  return {model.structure, model.interface, sliding.equilibrium};
}

inline State mode_start(const Sliding& sliding, double q)
{
  State state{copy_of(sliding.equilibrium.u.get()), copy_of(sliding.equilibrium.u.get()), 0,
              sliding.equilibrium.reactions};
  const double sigma = sliding.mode.lambda.real(), omega = sliding.mode.lambda.imag();
  check(VecAXPY(state.u, q, sliding.mode.real));
  check(VecAXPBYPCZ(state.v, q * sigma, -q * omega, 0, sliding.mode.real, sliding.mode.imaginary));
  return state;
}

inline const Complex at_three_tenths(0.0245, 1.06); // where to look at mu = 0.3

} // namespace squeal::test
