#pragma once
/// Whether neighbouring elements fit together.
#include "squeal/mesh/mesh.hpp"

namespace squeal
{

/// Throws Error for two elements on the same nodes, and for an edge whose mid-side node a neighbour on the same corners
/// lacks. Displacements would then differ between the neighbours.
void check_conformity(const Mesh& mesh, const Scene& scene);

} // namespace squeal
