#pragma once
/// Every pair of a band of the full quadratic problem, slice by slice of frequency, each from a complex shift at its
/// middle (complex_shift.hpp).
///
/// Slices are planned on the frictionless pairs, lambda^2 + c lambda + omega^2 = 0 with the modal damping c = x'C x of
/// the real modes x, which also count.
/// Friction turns pairs about zero, by as much as it changes their damping ratio: a slice holds those turned by .03,
/// and where pairs are missing in the end, by .1. Caveat: a pair that turns further, or whose oscillation stops, shows
/// in the count; TOAR (quadratic.hpp) knows no slices.
#include "squeal/analysis/quadratic.hpp"
#include "squeal/analysis/real_modes.hpp"

namespace squeal
{

/// Pairs that friction and damping move are still pairs: as mu grows from zero their number in a disc |lambda| < omega
/// changes only where one crosses its edge, and frictionless undamped modes are counted by inertia (Sylvester).
struct PairCount
{
  double frequency = 0; // [Hz] up to which both were counted; the band or a little more
  int expected = 0;     // real modes below
  int found = 0;        // pairs with |lambda| below
};

/// Of both below `edge` [rad/s]; `omega`: the real modes, ascending, of which those below `floor` are no vibrations.
PairCount count_pairs(const QuadraticSolution& solution, const std::vector<double>& omega, double floor, double edge);

/// solution.pairs reach up to count.frequency.
struct CountedSolution
{
  QuadraticSolution solution;
  PairCount count;
};

/// lambda with |lambda| = omega of the real modes, and their modal damping: an overdamped one lies at -omega.
std::vector<std::complex<double>> predicted_pairs(const RealModes& modes, Mat C);

/// `predicted`: ascending, all up to `reach` [Hz] at or above the band. Where one more or less lies below the edge, the
/// edge moves on between band and reach.
CountedSolution solve_by_slices(const QuadraticProblem& problem, const std::vector<std::complex<double>>& predicted,
                                double band, double reach);

} // namespace squeal
