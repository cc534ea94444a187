#pragma once
/// Tightening of bolts along the load path.
#include "squeal/contact/interface.hpp"

namespace squeal
{

/// Finds the shortenings that give bolts their tension in the equilibrium at the ends of the steps that tighten them.
/// Adds what they do to the loads of these steps and all later ones. Newton's method, with the slopes by differences.
/// Collective. Throws Error where there is no such equilibrium.
void tighten(Structure& structure, const Interface& interface);

} // namespace squeal
