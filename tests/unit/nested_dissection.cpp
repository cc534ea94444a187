// ranks: 1 2 3 4
// Nested dissection that ranks do together: an order at all, and one of the same quality as that of one rank. Both are
// heuristics from different divisions: the entries of the factors differ by some per cent.
#include "../../src/algebra/nested_dissection.hpp"

#include "../../src/algebra/symbolic_factor.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <doctest/doctest.h>
#include <numeric>
#include <petscsys.h>
#include <set>

using namespace squeal;

namespace
{

/// Nodes of a square grid with their neighbours along both axes.
WeightedGraph grid(int side)
{
  WeightedGraph whole;
  for (int node = 0; node < side * side; ++node)
  {
    std::vector<idx_t>& neighbours = whole.graph.neighbours;
    if (node / side > 0) neighbours.push_back(node - side);
    if (node % side > 0) neighbours.push_back(node - 1);
    if (node % side + 1 < side) neighbours.push_back(node + 1);
    if (node / side + 1 < side) neighbours.push_back(node + side);
    whole.graph.offsets.push_back(static_cast<idx_t>(neighbours.size()));
    whole.weights.push_back(1);
  }
  return whole;
}

/// The lower triangle of a matrix of that graph.
Triplets pattern_of(const Graph& graph)
{
  Triplets lower;
  for (int node = 0; node < graph.nodes(); ++node)
  {
    lower.row.push_back(node + 1);
    lower.column.push_back(node + 1);
    for (const idx_t neighbour : graph.of(node))
      if (neighbour < node) lower.row.push_back(node + 1), lower.column.push_back(neighbour + 1);
  }
  return lower;
}

bool is_first()
{
  int rank = 0;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  return rank == 0;
}

} // namespace

TEST_CASE("each node has a position of its own, in graphs of no node, of a few, of many, and of several parts")
{
  for (const int side : {0, 1, 7, 90})
    for (const bool in_parts : {false, true})
    {
      WeightedGraph whole = grid(side);
      const auto nodes = static_cast<std::size_t>(side * side);
      if (in_parts) // none has a neighbour
      {
        whole.graph.neighbours.clear();
        std::fill(whole.graph.offsets.begin(), whole.graph.offsets.end(), 0);
      }
      std::vector<idx_t> position =
          nested_dissection(is_first() ? std::move(whole) : WeightedGraph(), PETSC_COMM_WORLD);
      if (!is_first()) continue;
      std::sort(position.begin(), position.end());
      std::vector<idx_t> all(nodes);
      std::iota(all.begin(), all.end(), 0);
      CHECK(position == all);
    }
}

TEST_CASE("dense graphs, of which METIS makes halves without nodes, have an order on all ranks")
{
  constexpr int nodes = 2100;
  WeightedGraph whole;
  for (int node = 0; is_first() && node < nodes; ++node)
  {
    for (int other = 0; other < nodes; ++other)
      if (other != node) whole.graph.neighbours.push_back(other);
    whole.graph.offsets.push_back(static_cast<idx_t>(whole.graph.neighbours.size()));
    whole.weights.push_back(1);
  }
  const std::vector<idx_t> position = nested_dissection(std::move(whole), PETSC_COMM_WORLD);
  if (is_first()) CHECK(std::set<idx_t>(position.begin(), position.end()).size() == nodes);
}

TEST_CASE("an analysis that all ranks made serves the first rank, and each of them alone makes its own")
{
  const Triplets lower = pattern_of(grid(50).graph);
  KnownAnalyses known;
  for (int round = 0; round < 2; ++round)
  {
    const SymbolicFactor together = known.analyse(is_first() ? lower : Triplets(), 2500, 0, PETSC_COMM_WORLD);
    CHECK(together.supernodes.empty() == !is_first());
    CHECK(known.analyse(lower, 2500, 0, PETSC_COMM_SELF).position.size() == 2500);
  }
}

TEST_CASE("ranks find an order as good as that of one of them")
{
  const Triplets lower = pattern_of(grid(120).graph);
  const int nodes = 120 * 120;
  const double entries = analyse(is_first() ? lower : Triplets(), nodes, 0, PETSC_COMM_WORLD).entries;
  if (!is_first()) return;
  const double alone = analyse(lower, nodes, 0, PETSC_COMM_SELF).entries;
  CHECK(entries < 1.1 * alone);
}
