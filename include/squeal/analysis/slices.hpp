#pragma once
/// Every pair of a band of the full quadratic problem, slice by slice of frequency, in real arithmetic.
///
/// Without damping, theta = -lambda^2 is an eigenvalue of the real unsymmetric pencil K y = theta M y, which real
/// shifts near theta = omega_0^2 slice, where a real shift of lambda reaches no oscillating pair above. Damping is then
/// small beside what the slice's factor holds: the space of the undamped modes is corrected by the residuals of the
/// damped pairs until each has its backward error in the full problem.
/// Caveat: damping strong enough to move pairs across slices, or to stop their oscillation, shows in the count; TOAR
/// (quadratic.hpp) knows no slices.
#include "squeal/analysis/block.hpp"
#include "squeal/analysis/quadratic.hpp"

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

/// solution.pairs reach up to count.frequency.
struct CountedSolution
{
  QuadraticSolution solution;
  PairCount count;
};

/// `omega` [rad/s]: the frictionless undamped modes, ascending, all up to `reach` [Hz] at or above the band. Where one
/// mode more or less lies below the edge, the edge moves on between band and reach.
CountedSolution solve_by_slices(const QuadraticProblem& problem, const std::vector<double>& omega, double band,
                                double reach);

/// The pair nearest lambda, from a space that nearly holds it; its backward error says how near 1e-13 it came.
Eigenpair solve_near(const QuadraticProblem& problem, std::complex<double> lambda, Block start);

} // namespace squeal
