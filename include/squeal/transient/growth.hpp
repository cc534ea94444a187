#pragma once
/// Growth of one mode during a transient (src/README.md, section 4.12).
///
/// In persistent sliding the step is linear and leaves the plane of the mode invariant: (u - u0, v) = Re(q (phi, lambda
/// phi)), and q grows by exp(lambda_h h) a step, lambda_h the discrete eigenvalue. |q| is found by projection in the
/// energy inner product. Unlike the energy it has no ripple at 2 omega, so its logarithm is a straight line in time.
/// Functions that take matrices or vectors are collective.
#include "squeal/modes/modes.hpp"

namespace squeal
{

/// The modulus of q in time, and what its projection needs.
struct ModeAmplitude
{
  const ComplexMode* mode = nullptr;
  Owned<Vec> v_real, v_imaginary;        // lambda phi
  double K_real = 0, K_imaginary = 0;    // phi' K u0
  double rr = 0, ri = 0, ii = 0;         // Gram matrix of Re and Im of (phi, lambda phi) in the energy inner product
  std::vector<double> time, log_modulus; // [s], of q
};

/// Begins to observe a mode, which it borrows.
ModeAmplitude follow(const Structure& structure, const Equilibrium& equilibrium, const ComplexMode& mode);

/// Notes |q| of a state given by its products K u and M v.
void observe(ModeAmplitude& amplitude, double time, Vec Ku, Vec Mv);

/// Least-squares slope of ln|q| over the whole periods observed [1/s]; NaN when there is not one.
double growth_rate(const ModeAmplitude& amplitude, double period);

} // namespace squeal
