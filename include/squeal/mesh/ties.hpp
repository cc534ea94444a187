#pragma once
/// Ties of surfaces whose meshes need not match: the bilateral form of the pairs' rows (src/README.md, section 1.9).
/// The row of slave node i,  sum of slave weights u = sum of c_ij u_j,  is solved for u_i, so that a tie is an exact
/// constraint.
#include "squeal/mesh/contact_pairs.hpp"

namespace squeal
{

/// A node that follows others: u = sum of weight u_node. Others may be tied themselves, mid-sides to their corners.
struct TiedNode
{
  int node = 0, tie = 0; // tie: index in Scene::ties
  std::vector<PairNode> others;
};

/// The slave nodes of all ties.
struct TiedNodes
{
  std::vector<TiedNode> nodes;
  std::vector<Coverage> coverage; // one a tie
};

/// A slave node below a tenth of its uncovered area is left free. Throws Error for a missing surface and for surfaces
/// that share nodes or do not meet. It does so for a node that is tied twice, and for a slave node that is on the
/// master of a tie. Not collective: the mesh is whole on every rank.
TiedNodes tied_nodes(const Mesh& mesh, const Scene& scene);

} // namespace squeal
