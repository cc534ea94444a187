#pragma once
/// Sparse rows that read motions of nodes: gaps, sliding velocities, probes.
#include "squeal/solid/structure.hpp"

namespace squeal
{

using Row = std::map<PetscInt, double>;

/// row += direction . u(node), through the constraints.
void add_motion(const DofMap& dofs, int node, const Vec3& direction, Row& row);

/// AIJ matrix of this rank's rows.
Owned<Mat> matrix_of_rows(const std::vector<Row>& rows, PetscInt local_columns, MPI_Comm comm);

/// This rank's share of `count` rows or pairs: ranks in order, [first, second).
std::pair<PetscInt, PetscInt> share_of(PetscInt count, MPI_Comm comm);

} // namespace squeal
