#pragma once
/// Sliding equilibrium in unilateral contact with Coulomb friction (method, section 2):
///     K u0 = F + B_n' r_n + B_t' r_t,   0 <= g _|_ r_n >= 0,   r_t = mu r_n v_d/|v_d|.
/// Status (active set) iteration on the condensed compliance D = B K^-1 B'; projection fixed point as the check.
#include "squeal/analysis/state.hpp"

namespace squeal
{

/// outcome: "converged", "no equilibrium" (the status sets cycle, or mu is too large), "not converged".
/// residual: the largest natural map of a pair over the largest reaction.
struct Equilibrium
{
  Outcome outcome;
  Owned<Vec> u;                  // [m]
  std::vector<double> reactions; // [N] block entries a pair
  std::vector<char> closed;      // per pair
  double force_residual = 0;     // |K u - F - B'r| / |F|
  double check_residual = 0;     // the fixed point's natural map at the found solution
};

/// Options, prefix -equilibrium_: max_it (100), check_max_it (of the fixed point). Errors: K singular on a body that
/// contact does not hold either (which body).
Equilibrium find_equilibrium(const Structure& structure, const Interface& interface);

} // namespace squeal
