#pragma once
/// Frontal matrices of a supernodal factor: assembly and elimination.
#include "symbolic_factor.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace squeal
{

/// Entries of a matrix by columns, in the order of elimination.
struct Columns
{
  std::vector<std::size_t> starts;
  std::vector<int> rows;
  std::vector<double> values;
};

/// `lower`: the lower triangle of A and, from row dofs + 1 on, B.
Columns ordered(const Triplets& lower, const SymbolicFactor& symbolic);

/// Row and column of entry k in the order of elimination.
inline std::pair<int, int> place_of(const Triplets& lower, std::size_t k, const SymbolicFactor& symbolic)
{
  const int i = lower.row[k] - 1, q = symbolic.position[static_cast<std::size_t>(lower.column[k] - 1)];
  const int p = i < symbolic.dofs ? symbolic.position[static_cast<std::size_t>(i)] : i;
  return {std::max(p, q), std::min(p, q)};
}

/// The lower triangle of the frontal matrix of a supernode. It has columns for its pivots and inner rows, and the same
/// rows followed by those of the border.
struct Front
{
  const Supernode& supernode;
  const int* below; // positions of the rows below
  double* values;

  std::size_t height() const { return static_cast<std::size_t>(supernode.height()); }
  std::size_t pivots() const { return static_cast<std::size_t>(supernode.columns); }
  double* column(std::size_t j) const { return values + j * height(); }
};

std::size_t front_size(const Supernode& supernode);

/// Size of the update that a front leaves to its parent, inner columns with `below` rows each.
std::size_t update_size(const Supernode& supernode);

/// Sets the front to the entries of A and B in its columns, and `local` to the row in the front of each position.
/// Entries whose row has a negative `local` are left out.
void assemble(const Front& front, const Columns& A, std::vector<int>& local);

/// An update that a child left: `inner` columns of below.size() rows each, whose positions `below` are.
struct Update
{
  std::size_t inner;
  std::span<const int> below;
  const double* values;
};

/// Adds an update to the front of its parent, but for the rows whose `local` is negative.
void add_update(const Front& front, const Update& update, const std::vector<int>& local);

/// Copies what the front leaves to its parent.
void copy_update(const Front& front, double* to);

/// Factorises the pivots and subtracts their products from the inner rows. Returns false if a pivot is not positive.
bool eliminate_pivots(const Front& front);

} // namespace squeal
