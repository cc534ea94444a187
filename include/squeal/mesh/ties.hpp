#pragma once
/// Ties of surfaces whose meshes need not match: the bilateral form of the pairs' rows (src/README.md, section 1.9).
/// The row of slave node i,  sum of slave weights u = sum of c_ij u_j,  is solved for u_i. A tie is then an exact
/// constraint. A mid-side of a solid on an edge that a shell shares follows the edge's ends, between which the shell is
/// linear.
#include "squeal/mesh/contact_pairs.hpp"

namespace squeal
{

/// A node that follows others: u = sum of weight u_node + theta x arm, theta its own rotation if it has one. Others may
/// be tied themselves, mid-sides to their corners.
struct TiedNode
{
  int node = 0, tie = 0; // tie: index in Scene::ties; -1 of a mid-side on the edge of a shell
  std::vector<PairNode> others;
  Vec3 arm{}; // [m] from the mean of the others' places to the node's
};

/// The slave nodes of all ties, and the mid-sides on edges of shells.
struct TiedNodes
{
  std::vector<TiedNode> nodes;
  std::vector<Coverage> coverage; // one a tie
};

/// A slave node of a surface below a tenth of its uncovered area is left free. Throws Error for a missing surface and
/// for surfaces that share nodes or do not meet. It does so for a node that is tied twice, and for a slave node that is
/// on the master of a tie. The mesh must be whole.
TiedNodes tied_nodes(const Mesh& mesh, const Scene& scene);

} // namespace squeal
