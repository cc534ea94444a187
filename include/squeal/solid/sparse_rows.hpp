#pragma once
/// Sparse rows on the free degrees of freedom, for matrices that read displacements of nodes: gaps, sliding velocities,
/// probes.
#include "squeal/solid/structure.hpp"

namespace squeal
{

using SparseRow = std::map<PetscInt, double>; // coefficient of each free degree of freedom

/// Adds direction . u(node) to a row.
void add_displacement(const DofMap& dofs, int node, const Vec3& direction, SparseRow& row);

/// Returns the AIJ matrix with this rank's rows. Collective.
Owned<Mat> matrix_of_rows(const std::vector<SparseRow>& rows, PetscInt local_columns, MPI_Comm comm);

/// Returns this rank's range [first, last) of `count` items that are shared equally among the ranks in order. Not
/// collective.
std::pair<PetscInt, PetscInt> local_range(PetscInt count, MPI_Comm comm);

/// The node that each probe reads, by its place in the whole mesh: of its point, body or group, the nearest to its
/// position. Not collective.
/// Throws Error for one that is not there or is not the only one.
std::vector<int> probed_nodes(const std::vector<Probe>& probes, const Mesh& mesh);

/// Returns the matrix P with a row for each probe: the values of the probes are P q. Values are displacements [m].
/// Collective. Throws Error for a node that is not there, is not the only one or
/// cannot move.
Owned<Mat> probe_rows(const std::vector<Probe>& probes, const Mesh& mesh, const DofMap& dofs, MPI_Comm comm);

} // namespace squeal
