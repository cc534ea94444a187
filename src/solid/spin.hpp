#pragma once
/// Parts that spin, in the frame at rest (src/README.md, section 1.10).
#include "squeal/solid/structure.hpp"

namespace squeal
{

/// Adds G, and to K the centrifugal part with the stiffness of the centrifugal stress. M, C and K are assembled.
/// Collective. Throws Error for a part that spins and is no solid of revolution
/// about its axis.
void add_spin(Structure& structure, const NumberedMesh& numbered, const Scene& scene);

} // namespace squeal
