#pragma once
/// Every pair of a band of the full quadratic problem, slice by slice of frequency.
///
/// A slice starts from the undamped problem with friction, K x = theta M x, real and unsymmetric: the invariant
/// subspace V of all theta about the slice's middle sigma, by one real factor of K - sigma M (shift_invert.hpp). Under
/// Rayleigh damping, C = alpha M + beta K, the pairs of the quadratic problem lie in V: theta (1 + beta lambda) =
/// -lambda (lambda + alpha). What other damping adds is what residuals r of the pairs on V show; (K - sigma M)^-1 r
/// joins V until all are exact (projection.hpp).
///
/// Friction turns theta about zero: a slice holds all turned by .06, and where pairs are missing in the end, by .2.
/// Caveat: a pair that turns further, or whose oscillation stops, shows in the count; TOAR (quadratic.hpp) knows no
/// slices.
#include "squeal/modes/quadratic.hpp"
#include "squeal/modes/real_modes.hpp"

namespace squeal
{

/// Pairs that friction and damping move are still pairs: as mu grows from zero their number in a disc |lambda| < omega
/// changes only where one crosses its edge, and frictionless undamped modes are counted by inertia (Sylvester).
struct PairCount
{
  double frequency = 0; // [Hz] up to which both were counted
  int expected = 0;     // real modes below
  int found = 0;        // pairs with |lambda| below
};

/// Both below `top`, or, where one more or less lies there, below the highest gap between pairs from `least` on where
/// they agree [rad/s]. `free`: motions of a free body, which are no vibrations.
PairCount count_pairs(const QuadraticSolution& solution, RealCount& real, int free, double least, double top);

/// solution.pairs reach up to count.frequency.
struct CountedSolution
{
  QuadraticSolution solution;
  PairCount count;
};

/// All pairs below the band [Hz], and a little further for the count, which `real` plans and checks.
CountedSolution solve_by_slices(const QuadraticProblem& problem, RealCount& real, double band);

} // namespace squeal
