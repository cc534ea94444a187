#pragma once
/// Matrices that read the displacements at probes.
#include "squeal/solid/structure.hpp"

namespace squeal
{

/// The node that each probe reads, by its place in the whole mesh: of its point, body or group, the nearest to its
/// position. Not collective.
/// Throws Error for one that is not there or is not the only one.
std::vector<int> probed_nodes(const std::vector<Probe>& probes, const Mesh& mesh);

/// Returns the matrix P with a row for each probe: the values of the probes are P q. Values are displacements [m].
/// Collective; rank 0 has the mesh and T whole. Throws Error for a node that is not there, is not the only one or
/// cannot move.
Owned<Mat> probe_rows(const std::vector<Probe>& probes, const Mesh& mesh, const DofMap& dofs, MPI_Comm comm);

} // namespace squeal
