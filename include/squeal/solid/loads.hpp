#pragma once
/// Forces and pressures on the free degrees of freedom.
#include "squeal/solid/structure.hpp"

namespace squeal
{

/// Returns the load T' f of the scene's forces and pressures [N, N m]. Collective; rank 0 has the mesh and T whole.
Owned<Vec> assemble_load(const Mesh& mesh, const Scene& scene, const DofMap& dofs, MPI_Comm comm);

} // namespace squeal
