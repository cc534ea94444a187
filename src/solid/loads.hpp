#pragma once
/// Forces and pressures on the free degrees of freedom.
#include "squeal/solid/structure.hpp"

namespace squeal
{

Owned<Vec> assemble_load(const Mesh& mesh, const Scene& scene, const Partition& partition, const DofMap& dofs,
                         MPI_Comm comm);

} // namespace squeal
