#pragma once
/// Contact pairs of two surfaces whose meshes need not match (src/README.md, section 1.9). The distribution of nodes
/// over the ranks keeps pairs together.
#include "squeal/mesh/mesh.hpp"

namespace squeal
{

/// A node that a pair reads.
struct PairNode
{
  int node;
  double weight; // in the pair's gap: those of the stator's nodes add up to 1, those of the rotor's to -1
};

/// A contact pair: its gap opens with the weighted sum of the nodes' displacements, along the normal.
struct ContactPair
{
  int rotor_node = 0, stator_node = 0; // those of largest weight
  int node = 0;                        // the one of the slave side, to which the pair belongs
  Vec3 position{};                     // [m] mean of the rotor's nodes with their weights: where the reactions act
  Vec3 normal{};                       // [-] unit, out of the rotor into the stator
  double area = 0;                     // [m2] reaction over pressure; 0 for points
  int contact = 0;                     // index in Scene::contacts
  double gap = 0;                      // [m] initial distance of the surfaces; 0 for a contact without a reach
  std::vector<PairNode> nodes;         // the slave side's first
  int slave_nodes = 1;                 // number of the slave side's
};

/// The part of a contact's slave surface that faces the master surface, and the mismatch that curvature leaves.
struct Coverage
{
  double area = 0, covered = 0; // [m2] of the slave surface
  Vec3 uncovered_at{};          // [m] centre of the slave face with the largest uncovered area
  double closed = 0;            // [m] largest mismatch of the surfaces that a contact without a reach ignores
  double offset = 0;            // [m] largest tangential distance of the points where a pair's two forces act
};

/// The pairs of all contacts.
struct ContactPairs
{
  std::vector<ContactPair> pairs;
  std::vector<Coverage> coverage; // one a contact; zeros for points
};

/// Returns the pairs in the order of the contacts, in each by the rotor's nodes. Throws Error for a missing surface or
/// point, and for a slave surface that supports or rigid bodies hold. It does so for surfaces that share nodes, are
/// nowhere within reach of each other, look the same way or are inside each other. The mesh must be whole.
ContactPairs make_pairs(const Mesh& mesh, const Scene& scene);

/// Owner of each node.
struct Partition
{
  std::vector<int> node_rank;
};

/// Returns a partition by METIS, the same at every call. The two heaviest nodes of a pair, one of each side, have the
/// same owner. The mesh must be whole. Throws Error if there are more ranks than nodes.
Partition partition_mesh(const Mesh& mesh, const std::vector<ContactPair>& pairs, int ranks);

// Ties of surfaces whose meshes need not match: the bilateral form of the pairs' rows (src/README.md, section 1.9).
// The row of slave node i,  sum of slave weights u = sum of c_ij u_j,  is solved for u_i. A tie is then an exact
// constraint. A mid-side of a solid on an edge that a shell shares follows the edge's ends, between which the shell is
// linear.

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
