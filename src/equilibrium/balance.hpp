#pragma once
/// Whether an equilibrium balances the load (src/README.md, section 2.6).
#include "squeal/equilibrium/equilibrium.hpp"

namespace squeal
{

/// Sets the force residual. Returns whether it is small, or at the rounding of K u: a soft support lets u be large
/// beside the strains. Collective.
bool balances(const Structure& structure, const Interface& interface, Equilibrium& equilibrium);

} // namespace squeal
