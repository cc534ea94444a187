#pragma once
/// Ordering and symbolic factorisation of a bordered symmetric matrix.
///
/// Degrees of freedom with equal neighbours are taken as one node, METIS orders the nodes by nested dissection, and
/// the border follows last. Supernodes are runs of neighbouring columns of the factor with the same rows below. Small
/// ones are joined with their parent, at the price of some zeros (relaxed amalgamation; Ashcraft and Grimes 1989).
#include "triplets.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

namespace squeal
{

/// A place in a list, from a number as METIS and MPI have them.
inline std::size_t at(int number)
{
  return static_cast<std::size_t>(number);
}

/// Neighbouring columns of the factor with the same rows below.
struct Supernode
{
  int first = 0, columns = 0;   // its pivots, as positions in the order of elimination
  int below = 0, border = 0;    // rows below its pivots; the last `border` of these belong to the border
  std::size_t rows_begin = 0;   // of the rows below, in SymbolicFactor::rows
  std::size_t values_begin = 0; // of its packed triangle in the factor; the panel below follows it
  std::vector<int> children{};  // supernodes that update it

  int height() const { return columns + below; }
  int inner() const { return below - border; } // rows below that are no border rows
};

struct SymbolicFactor
{
  int dofs = 0, border = 0;
  std::vector<int> position;         // of each degree of freedom in the order of elimination, from zero
  std::vector<Supernode> supernodes; // children before parents, the last child right before its parent
  std::vector<int> rows;             // positions, ascending in a supernode; dofs + i for row i of the border
  std::size_t values = 0;            // numbers in the packed factor
  double entries = 0;                // of the factor, without the zeros of packing
};

/// The analyses of the last patterns by their hashes, the last one first. METIS takes as long as the factor itself
/// where that is small.
class KnownAnalyses
{
public:
  std::deque<std::pair<std::uint64_t, SymbolicFactor>> last{};
};

/// `lower`: the lower triangle of A and, from row dofs + 1 on, the border; read on rank 0, where the result is. A
/// pattern that is known is found again there. Entries in another order count as another pattern. Collective.
SymbolicFactor analyse(const Triplets& lower, int dofs, int border, MPI_Comm comm, KnownAnalyses* known = nullptr);

} // namespace squeal
