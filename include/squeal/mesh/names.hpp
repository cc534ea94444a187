#pragma once
/// Look-up of nodes and surfaces by the names that a scene uses.
///
/// `user` says in messages which table of the scene asks, such as "spring" or "probe tip". Every function throws Error
/// for an unknown name, with the nearest known one. The mesh must be whole.
#include "squeal/mesh/mesh.hpp"

namespace squeal
{

/// Returns the node of a point or rigid body.
int point_node(const Mesh& mesh, const std::string& name, const std::string& user);

/// Returns the node of a point or rigid body, or else the nodes of a group, ascending.
/// Throws Error for a group of several dimensions, as of a surface and a volume of one name.
std::vector<int> named_nodes(const Mesh& mesh, const std::string& name, const std::string& user);

/// Returns the faces of a surface.
const std::vector<Face>& named_faces(const Mesh& mesh, const std::string& name, const std::string& user);

/// Returns "node 12 at (x, y, z)" for messages.
std::string node_text(int node, const Vec3& position);

} // namespace squeal
