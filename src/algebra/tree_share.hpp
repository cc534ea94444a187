#pragma once
/// Share of a rank in a supernodal factor (src/README.md, section 8.2): whole subtrees of the elimination tree belong
/// to single ranks. The supernodes above them are shared: every rank holds their pivots and inner rows, and of their
/// border rows its own ones. So a rank eliminates and substitutes in its subtrees alone. What all ranks do side by
/// side above them has one exchange a half of a solve.
#include "symbolic_factor.hpp"

#include <cstddef>

namespace squeal
{

/// A subtree below a shared supernode: what its root leaves to be added there.
struct Subtree
{
  int owner = 0;            // rank
  std::size_t root = 0;     // in TreeShare::symbolic, on the owner only
  std::size_t inner = 0;    // columns of the root's update, below.size() rows each
  std::vector<int> below{}; // positions of the rows
};

/// The parts of a shared supernode that other ranks have.
struct SharedSupernode
{
  std::vector<Subtree> branches{};
  std::vector<int> border{}; // positions of its border rows on all ranks
};

struct TreeShare
{
  SymbolicFactor symbolic;             // this rank's supernodes, then the shared ones with this rank's border rows
  std::size_t own = 0;                 // number of supernodes that are not shared
  std::vector<SharedSupernode> shared; // in the order of the tree
  std::vector<int> owner;              // rank of each position's supernode, or everyone; empty on one rank
};

constexpr int everyone = -1;

/// The rank that holds this border row, counted from zero, of shared supernodes.
int holder_of(int border_row, int ranks);

/// `whole`: the analysis, read on rank 0. Collective.
TreeShare share_tree(SymbolicFactor whole, MPI_Comm comm);

} // namespace squeal
