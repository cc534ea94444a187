#pragma once
/// The order in which a bordered symmetric matrix is eliminated, and what its Cholesky factor then holds:
/// nested dissection by METIS of the degrees of freedom with equal neighbours taken as one, the border after them, and
/// supernodes: neighbouring columns of the factor with the same rows below.
#include "triplets.hpp"

#include <cstddef>
#include <vector>

namespace squeal
{

struct Supernode
{
  int first = 0, columns = 0;   // positions of its pivots
  int below = 0, bordering = 0; // rows below its pivots; of these, the last ones are the border's
  std::size_t rows = 0;         // where they begin in Elimination::rows
  std::size_t values = 0;       // where its packed triangle begins in the factor, and the panel below after it
  std::vector<int> children;    // supernodes whose update it takes

  int height() const { return columns + below; }
  int inner() const { return below - bordering; }
};

struct Elimination
{
  int dofs = 0, border = 0;
  std::vector<int> position;         // of every degree of freedom, from zero
  std::vector<Supernode> supernodes; // children before parents, each last child right before its parent
  std::vector<int> rows;             // positions, ascending; dofs + i for row i of the border
  std::size_t values = 0;            // numbers that the packed factor takes
  double entries = 0;                // of the factor
};

/// `lower`: the lower triangle of A and, from row dofs + 1 on, the border.
Elimination eliminate(const Triplets& lower, int dofs, int border);

} // namespace squeal
