#pragma once
/// Energy estimate of the cycle's amplitude (paper, eqs. 9-19; method, section 5): U = u0 + q Re(phi exp(i omega t)),
/// P_C(q)/E(q) = P_R(q)/E(q) with an interface force that saturates by lift-off and by slip reversal.
#include "squeal/analysis/modes.hpp"

namespace squeal
{

/// outcome: "balance", "no balance" (the curve has no root; never a number that is not one), "skipped".
/// residual: |P_R - P_C| / P_C at the root.
struct Estimate
{
  Outcome outcome;
  double amplitude = 0;            // q [m], the mode's largest entry being 1; 0 without balance
  double lift_off_amplitude = 0;   // [m] min r_n0/|rho|
  double reversal_amplitude = 0;   // [m] first slip reversal
  double damping_rate = 0;         // P_C/E [1/s], independent of q
  double friction_rate_linear = 0; // P_R/E as q -> 0 [1/s]; friction - damping = 2 Re(lambda)
  double phase = 0;                // [rad] turn of phi for which the smallest normal reaction at t = 0 is largest
  std::vector<double> curve_amplitude, curve_rate; // q [m] and P_R/E [1/s]
};

/// Options, prefix -estimate_: starting multiple of lift-off without balance is the user's of the result.
Estimate estimate_amplitude(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                            const ComplexMode& mode);

/// State u0 + q Re(phi e^{i phase}), v = q Re(lambda phi e^{i phase}) (paper, eqs. 18-19).
State mode_state(const Equilibrium& equilibrium, const ComplexMode& mode, double amplitude, double phase);

} // namespace squeal
