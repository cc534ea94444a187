#pragma once
/// Signorini-Coulomb contact of one pair, all others held: find r with w = A r + q,
///     0 <= w_n _|_ r_n >= 0,   |r_t| <= mu r_n,   w_t = -sigma r_t with sigma >= 0 (zero while |r_t| < mu r_n).
/// A is the pair's own block of W, symmetric and positive semi-definite, 1 + directions square.
///
/// Solved to round-off by cases. Open: q_n >= 0. Stick: A r = -q. Slip: r_t = mu r_n d with a unit d, so that w_n = 0
/// gives r_n = -q_n / (A_nn + mu A_nt d), and d is a zero of the cross product of d and w_t, a trigonometric polynomial
/// of degree two in the angle of d (the quartic of Bonnefon and Daviet, 2011, in angle form): Newton from the last
/// direction, a scan of the circle when that fails.
///
/// Caveat: a direction in which neither side can move (a zero row of W) keeps Coulomb's law: sliding there, r_t opposes
/// the drive although it moves nothing; at rest there, r_t is zero along it.
#include <array>

namespace squeal
{

using PairVector = std::array<double, 3>; // n, t1, t2; t2 stays 0 in plane friction
using PairBlock = std::array<PairVector, 3>;

/// `last`: the pair's reaction so far, which decides between several slip directions.
PairVector solve_pair(const PairBlock& A, const PairVector& q, int directions, double friction, const PairVector& last);

/// |r - proj(r - rho w)|, the natural map of one pair: zero where the law holds; rho_n, rho_t in force per velocity.
double natural_map(const PairVector& r, const PairVector& w, double friction, double rho_n, double rho_t);

/// Scales the tangential part of r back into the disc of radius mu max(0, r_n).
void project_on_disc(PairVector& r, double friction);

} // namespace squeal
