#pragma once
/// All pairs of a band of the full quadratic problem, by slices of frequency (src/README.md, sections 3.8 and 3.9).
///
/// A slice starts from the undamped problem with friction, K x = theta M x, real and unsymmetric. One real factor of
/// K - sigma M gives the invariant subspace V of all theta about the slice's middle sigma (shift_invert.hpp). Under
/// Rayleigh damping, C = alpha M + beta K, the pairs of the quadratic problem are in V: theta (1 + beta lambda) =
/// -lambda (lambda + alpha). Under other damping the pairs on V leave residuals r. (K - sigma M)^-1 r is appended to V
/// until all pairs are exact (projection.hpp).
///
/// Friction turns theta about zero. A slice holds all theta that are turned by up to 0.06 rad and, where pairs are
/// missing in the end, by 0.2 rad. Caveat: a pair that is turned further, or that no longer oscillates, is missing in
/// the count; TOAR (quadratic.hpp) does not use slices. Both functions are collective. Error: memory runs out.
#include "squeal/modes/quadratic.hpp"
#include "squeal/modes/real_modes.hpp"

namespace squeal
{

/// Pairs remain pairs when friction and damping move them. As mu grows from zero, their number in a disc |lambda| <
/// omega changes only where one crosses its edge. The modes at mu = 0 without damping are counted by inertia
/// (Sylvester).
struct PairCount
{
  double frequency = 0; // [Hz] up to which both were counted
  int expected = 0;     // real modes below
  int found = 0;        // pairs with |lambda| below
};

/// Counts both below `top` [rad/s]. Where they disagree, an edge between neighbouring pairs from `least` on serves: the
/// highest below which they agree. `moduli`: |lambda| of the pairs [rad/s].
/// `free`: motions of a free body, which are no vibrations.
PairCount count_pairs(std::vector<double> moduli, RealCount& real, int free, double least, double top);

/// solution.pairs reach up to count.frequency.
struct CountedSolution
{
  QuadraticSolution solution;
  PairCount count;
};

/// All pairs below the band [Hz] and, for the count, a little beyond. `real` gives the slices and the expected count.
CountedSolution solve_by_slices(const QuadraticProblem& problem, RealCount& real, double band,
                                const PencilOptions& options);

} // namespace squeal
