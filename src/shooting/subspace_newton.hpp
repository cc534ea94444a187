#pragma once
/// The paper's shooting on a subspace (src/README.md, section 6.4): x = x_k + E c with E energy-orthonormal, unknowns y
/// = (T, c),
///     R_0 = <f, x - anchor>,   R_i = <e_i, Phi_T(x) - x>,   i = 1 ... n.
/// f and the anchor are those of the last Jacobian: the Newton correction is orthogonal to the flow where it starts.
/// Everything is scaled by the fluctuation, so that y and R are of order one. With the paper's three shapes there are
/// seven unknowns, all on rank 0. Newton is SNES's; GMRES solves for its steps by columns of the exact tangent.
///
/// Caveat: a solution of the projected equations leaves a defect outside the subspace, which need not be small.
#include "squeal/shooting/multipliers.hpp"
#include "squeal/shooting/orbit.hpp"

namespace squeal
{

/// Damped Newton on T and the coordinates in `base` about the start (options -cycle_snes_...). Returns
/// the last orbit, which may be collapsing.
Orbit shoot_on_subspace(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                        const Orbit& start, const std::vector<Owned<Vec>>& base);

} // namespace squeal
