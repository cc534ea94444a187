#pragma once
/// Energy estimate of the cycle's amplitude (paper, eqs. 9-19; src/README.md, section 5). The motion is taken to be
///     u = u0 + q Re(phi e^{i w t}),  w = Im(lambda),
/// and q is sought for which the interface gives what the damping takes, P_R(q)/E = P_C/E, means over a period:
///     P_C = mean u'.C u',   P_R = mean sum w.(r_t - r_t0),  w = B_t u',
///     r_n = max(0, r_n0 + q Re(rho e^{i w t})),   r_t = -mu r_n s/|s|,   s = w - v_d:
/// The interface force saturates by lift-off and by reversal of the sliding. In it rho is what this motion takes in the
/// rows of the eliminated degrees of freedom at s = i w. It differs from the mode's own reaction, at lambda, by
/// Re(lambda)/w.
///
/// E is twice the mean kinetic energy, which is the mean energy of a free vibration. (Friction makes the mean
/// potential energy of the mode differ.) Then (P_R - P_C)/E -> 2 Re(lambda) as q -> 0, up to that difference of rho.
/// It does so if the modes have the damping of the friction direction, which the law above always has. Caveat: a start
/// for the shooting, not a prediction (src/README.md, section 5.5).
#include "squeal/modes/modes.hpp"

#include <optional>
#include <span>

namespace squeal
{

/// outcome: "balance", "no balance" (the curve has no root; never a number that is not one), "skipped" (the mode does
/// not vibrate). residual: |P_R - P_C| over the larger of P_C and the linear P_R, at the root; iterations: of the root.
struct Estimate
{
  Outcome outcome;
  double amplitude = 0;            // q [m], the mode's largest entry being 1; 0 without balance
  double mean_energy = 0;          // [J] E at that amplitude; compare with the cycle's mean fluctuating energy
  double lift_off_amplitude = 0;   // [m] min r_n0/|rho|; infinite where no reaction fluctuates
  double reversal_amplitude = 0;   // [m] first q at which some pair's sliding along the drive stops; or infinite
  double slip_amplitude = 0;       // [m] at which some pair that sticks reaches its friction; infinite: none does
  double damping_rate = 0;         // P_C/E [1/s], independent of q
  double friction_rate_linear = 0; // P_R/E as q -> 0 [1/s]; friction - damping = 2 Re(lambda)
  double start_amplitude = 0; // [m] where vibrations start: the balance, or a multiple of the first event without one
  double phase = 0;           // [rad] turn of phi for which the smallest normal reaction at t = 0 is largest
  std::vector<double> curve_amplitude, curve_rate; // q [m] and P_R/E [1/s]
};

/// [m] First lift-off or reversal of the sliding: below it a motion grows or decays as its mode does; or infinite.
double first_event(const Estimate& estimate);

/// [m] First lift-off, or reversal where nothing lifts off; or infinite.
double limiting_event(const Estimate& estimate);

/// Start amplitude over first lift-off, or over reversal where nothing lifts off, where there is no energy balance.
inline constexpr double lift_off_multiple = 2;

/// The phase is that of the amplitude found, or of first lift-off without balance. Collective. A mode without balance
/// is an outcome.
Estimate estimate_amplitude(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised,
                            const ComplexMode& mode);

/// State u0 + q Re(phi e^{i phase}), v = q Re(lambda phi e^{i phase}) (paper, eqs. 18-19). Absolute, with the reactions
/// of rest. `amplitude` [m], `phase` [rad].
State mode_state(const Equilibrium& equilibrium, const ComplexMode& mode, double amplitude, double phase);

/// The modes that grow, the followed one first, with an estimate each.
struct UnstableModes
{
  std::span<const ComplexMode> modes;
  std::span<const Estimate> estimates;
};

/// The motion of a mode at its estimate: q Re(phi e^{i phase}) and its velocity, without u0. None where the estimate
/// gives no amplitude to start from.
std::optional<State> estimated_motion(const Equilibrium& equilibrium, const ComplexMode& mode,
                                      const Estimate& estimate);

/// state += factor motion
void add_motion(const State& motion, double factor, State& state);

} // namespace squeal
