#pragma once
/// Nested dissection of a graph by METIS (Karypis and Kumar 1998), on all ranks.
#include <cstddef>
#include <metis.h>
#include <mpi.h>
#include <span>
#include <vector>

namespace squeal
{

/// A graph in compressed form: the neighbours of each node, one list after the other.
struct Graph
{
  std::vector<idx_t> offsets{0}, neighbours{};

  int nodes() const { return static_cast<int>(offsets.size()) - 1; }
  std::span<const idx_t> of(int node) const
  {
    const auto k = static_cast<std::size_t>(node);
    return {neighbours.data() + offsets[k], neighbours.data() + offsets[k + 1]};
  }
};

struct WeightedGraph
{
  Graph graph{};
  std::vector<idx_t> weights{}; // of the nodes
};

/// The position of each node in the order of elimination. The graph is read and the positions are given on the first
/// rank. The ranks divide a large graph by separators until each has a part, which it orders by itself. Collective.
/// Error: METIS finds no order.
std::vector<idx_t> nested_dissection(WeightedGraph whole, MPI_Comm comm);

} // namespace squeal
