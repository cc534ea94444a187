#pragma once
/// Contact pairs of coincident nodes.
#include "squeal/mesh/mesh.hpp"

namespace squeal
{

/// A node-to-node contact pair.
struct NodePair
{
  int a = 0;       // node of the rotor
  int b = 0;       // node of the stator
  Vec3 normal{};   // [-] unit, out of the rotor into the stator
  double area = 0; // [m2] tributary area of node a; 0 for points
  int contact = 0; // index in Scene::contacts
  double gap = 0;  // [m] distance of the nodes along the normal; 0 for a contact without a reach
};

/// Returns the contact pairs in the order of the contacts.
/// Throws Error for: a node of either surface without a partner within 1e-6 of the surface's size; partners farther
/// apart than the contact's reach; faces with nodal weights that are not all positive; a missing surface or point.
std::vector<NodePair> match_pairs(const Mesh& mesh, const std::vector<Contact>& contacts);

} // namespace squeal
