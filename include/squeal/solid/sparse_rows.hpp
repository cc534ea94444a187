#pragma once
/// Sparse rows on the free degrees of freedom, for matrices that read displacements of nodes: gaps, sliding velocities,
/// probes.
#include "squeal/solid/structure.hpp"

namespace squeal
{

using SparseRow = std::map<PetscInt, double>; // coefficient of each free degree of freedom

/// Adds direction . u(node) to a row.
void add_displacement(const DofMap& dofs, int node, const Vec3& direction, SparseRow& row);

/// Scatters rank 0's rows, the same number for each of `count` items: each rank gets those of the items in its local
/// range. Collective.
std::vector<SparseRow> scattered_rows(std::vector<SparseRow> rows, PetscInt count, MPI_Comm comm);

/// Returns the AIJ matrix with this rank's rows. Collective.
Owned<Mat> matrix_of_rows(const std::vector<SparseRow>& rows, PetscInt local_columns, MPI_Comm comm);

/// Returns this rank's range [first, last) of `count` items that are shared equally among the ranks in order. Not
/// collective.
std::pair<PetscInt, PetscInt> local_range(PetscInt count, MPI_Comm comm);

/// The range [first, last) of any rank.
std::pair<PetscInt, PetscInt> range_of(PetscInt count, PetscInt rank, PetscInt ranks);

} // namespace squeal
