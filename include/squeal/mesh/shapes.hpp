#pragma once
/// Topology of the elements on offer, in gmsh's node order (gmsh reference manual, "Node ordering").
#include "squeal/mesh/mesh.hpp"

#include <span>

namespace squeal
{

int corner_count(Shape shape);
int corner_count(FaceShape shape);

/// The two corners on either side of each mid-side node, in the order of the mid-side nodes. Empty if there are none.
std::span<const std::array<int, 2>> mid_sides(Shape shape);

/// Corners of each face of a solid, counter-clockwise seen from outside; -1 after the third of a triangle.
std::span<const std::array<int, 4>> corner_faces(Shape shape);

/// For each place, which node goes there so that the element is mirrored: turns an inside-out solid outside-out.
std::vector<int> mirrored_order(Shape shape);
std::vector<int> mirrored_order(FaceShape shape);

} // namespace squeal
