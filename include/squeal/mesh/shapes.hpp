#pragma once
/// Topology of shapes, in gmsh's node order (gmsh reference manual, "Node ordering"). Node numbers count from 0 within
/// the element or face. Tables of one rank; no function throws.
#include "squeal/mesh/mesh.hpp"

#include <optional>
#include <span>

namespace squeal
{

/// Returns the shape of a gmsh element type; nothing if squeal does not know it.
std::optional<Shape> shape_of(int gmsh_type);

/// Number of nodes, number of corners, dimension, and whether an element of this shape is a shell.
int node_count(Shape shape);
int corner_count(Shape shape);
int dimension_of(Shape shape);
bool is_shell(Shape shape);

/// Returns the nodes that the element or face uses.
std::span<const int> nodes_of(const Element& element);
std::span<const int> nodes_of(const Face& face);

/// Returns where nodes are [m].
std::vector<Vec3> positions_of(const Mesh& mesh, std::span<const int> nodes);

/// Returns the two end nodes of the side of each mid-side node, in the order of the mid-side nodes.
std::span<const std::array<int, 2>> mid_sides(Shape shape);

/// Returns the corners of each face of a solid, counter-clockwise seen from outside. A triangle has -1 as its fourth.
std::span<const std::array<int, 4>> corner_faces(Shape shape);

/// Returns the corner nodes of each face of a solid, counter-clockwise seen from outside.
std::vector<std::vector<int>> faces_of(const Element& element);

/// Returns the node order of the mirrored element or face: entry i is the old number of the new node i.
/// An element numbered inside out has a positive Jacobian in this order.
std::vector<int> mirrored_order(Shape shape);

} // namespace squeal
