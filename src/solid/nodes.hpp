#pragma once
/// Nodes by the names that a scene uses, and motions: motion 6 * node + c is component c of a node, c = 0..5 for x y z
/// rx ry rz.
#include "squeal/mesh/mesh.hpp"

namespace squeal
{

/// "node 12 at (x, y, z)"
std::string node_text(int node, const Vec3& at);
std::string node_text(const Mesh& mesh, int node);

/// The node of a point or rigid body, or else the nodes of a group. Error: no such name; `asker` is who named it.
std::vector<int> nodes_named(const Mesh& mesh, const std::string& name, const std::string& asker);

/// The node of a point or rigid body.
int point_named(const Mesh& mesh, const std::string& name, const std::string& asker);

} // namespace squeal
