#pragma once
/// The pairs of (lambda^2 M + lambda C + K) y = 0 nearest a complex shift s, whatever the damping, by block Arnoldi of
///     (A - s B)^-1 B,   A = [0 I; -K -C],  B = [I 0; 0 M],  z = (y, lambda y),
/// eigenvalues 1/(lambda - s), which takes one solve with Q(s) a vector (Meerbergen 2001). Time is scaled by |s|.
///
/// Blocks, because brakes have many nearly equal modes (doublets of a disc, one a pin), which a space grown from a
/// single vector finds late or never. No restarts: a shift is moved on instead.
#include "squeal/analysis/complex_factor.hpp"

namespace squeal
{

struct NearestPairs
{
  std::vector<std::complex<double>> lambda;
  ComplexBlock y;
  bool converged = false; // or the space grew to its limit, and nothing is given
};

/// All with |lambda - s| <= radius, s that of the factor, and at least the `count` nearest.
NearestPairs solve_nearest_pairs(const QuadraticProblem& problem, const ComplexFactor& factor, double radius,
                                 int count);

/// The pair nearest lambda; its backward error is infinite if none was found.
Eigenpair solve_near(const QuadraticProblem& problem, std::complex<double> lambda);

} // namespace squeal
