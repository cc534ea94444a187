#pragma once
/// Distribution of nodes and elements over the ranks.
#include "squeal/mesh/contact_pairs.hpp"

namespace squeal
{

/// Owner of each node and of each element.
struct Partition
{
  std::vector<int> node_rank;
  std::vector<int> element_rank; // the rank that owns most of the element's nodes
};

/// Returns a partition by METIS, the same at every call. The two heaviest nodes of a pair, one of each side, have the
/// same owner. The mesh must be whole. Throws Error if there are more ranks than nodes.
Partition partition_mesh(const Mesh& mesh, const std::vector<ContactPair>& pairs, int ranks);

} // namespace squeal
