#pragma once
/// Joins superelements to the nodes of a mesh.
#include "squeal/mesh/mesh.hpp"

#include <mpi.h>

namespace squeal
{

/// Adds the scene's superelements to the mesh. Collective.
/// Throws Error for a retained node that meets no node of the groups it is joined to, or one that is taken.
void add_superelements(const Scene& scene, Mesh& mesh, MPI_Comm comm);

} // namespace squeal
