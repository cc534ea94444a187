#pragma once
/// Joins superelements to the nodes of a mesh.
#include "squeal/mesh/mesh.hpp"

namespace squeal
{

/// Adds the scene's superelements to the mesh.
/// Throws Error for a retained node that meets no node of the groups it is joined to, or one that is taken.
void add_superelements(const Scene& scene, Mesh& mesh);

} // namespace squeal
