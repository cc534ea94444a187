// ranks: 1 2 3 4
// Orders of elimination by nested dissection.
#include "../../src/algebra/symbolic_factor.hpp"

#include <algorithm>
#include <doctest/doctest.h>
#include <numeric>

using namespace squeal;

namespace
{

/// The lower triangle of a matrix whose rows are a square grid's nodes, each with its neighbours along both axes.
Triplets grid(int side, bool has_neighbours)
{
  Triplets lower;
  const auto add = [&](int row, int column) { lower.row.push_back(row + 1), lower.column.push_back(column + 1); };
  for (int node = 0; node < side * side; ++node)
  {
    add(node, node);
    if (has_neighbours && node / side > 0) add(node, node - side);
    if (has_neighbours && node % side > 0) add(node, node - 1);
  }
  return lower;
}

/// Every row with every other one.
Triplets full(int size)
{
  Triplets lower;
  for (int row = 1; row <= size; ++row)
    for (int column = 1; column <= row; ++column) lower.row.push_back(row), lower.column.push_back(column);
  return lower;
}

bool is_first()
{
  return rank_of(PETSC_COMM_WORLD) == 0;
}

void check_positions(const Triplets& lower, int size)
{
  SymbolicFactor symbolic = analyse(is_first() ? lower : Triplets(), size, 0, PETSC_COMM_WORLD);
  if (!is_first()) return;
  std::vector<int> all(static_cast<std::size_t>(size));
  std::iota(all.begin(), all.end(), 0);
  std::sort(symbolic.position.begin(), symbolic.position.end());
  CHECK(symbolic.position == all);
}

} // namespace

TEST_CASE(
    "each row has a position of its own, in matrices of no row, of a few, of many, of several parts, and full ones")
{
  for (const int side : {0, 1, 7, 90})
    for (const bool has_neighbours : {true, false}) check_positions(grid(side, has_neighbours), side * side);
  for (const int size : {2, 500}) check_positions(full(size), size);
}

TEST_CASE("a full matrix is one supernode")
{
  const SymbolicFactor symbolic = analyse(full(300), 300, 0, PETSC_COMM_SELF);
  CHECK(symbolic.supernodes.size() == 1);
  CHECK(symbolic.entries == 300 * 301 / 2.);
}

TEST_CASE("an analysis for all ranks serves the first rank, and each of them alone makes its own")
{
  const Triplets lower = grid(50, true);
  KnownAnalyses known;
  for (int round = 0; round < 2; ++round)
  {
    const SymbolicFactor together = analyse(is_first() ? lower : Triplets(), 2500, 0, PETSC_COMM_WORLD, &known);
    CHECK(together.supernodes.empty() == !is_first());
    CHECK(analyse(lower, 2500, 0, PETSC_COMM_SELF, &known).position.size() == 2500);
  }
}
