#pragma once
/// Distribution of a mesh that rank 0 has numbered: every other rank receives what its rows of the matrices need.
#include "squeal/solid/dofs.hpp"

namespace squeal
{

/// Elements with their nodes and rows of T: the whole mesh on rank 0. On another rank those that it assembles and those
/// that share a degree of freedom with it, without named sets; nodes and elements are numbered within the piece.
struct MeshPiece
{
  Mesh mesh;
  Partition partition; // node_rank: on rank 0 alone
  DofMap dofs;
  std::vector<int> node_numbers{}, element_numbers{}; // in the whole mesh, ascending; empty: the same
};

/// Gives every other rank its piece of rank 0's mesh, in the order of the whole. Collective.
void distribute(MeshPiece& piece, MPI_Comm comm);

} // namespace squeal
