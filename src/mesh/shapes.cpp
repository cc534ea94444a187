#include "squeal/mesh/shapes.hpp"

#include <algorithm>
#include <iterator>

namespace squeal
{

namespace
{

using Side = std::array<int, 2>;
using CornerFace = std::array<int, 4>;

constexpr Side hex_sides[] = {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3},
                              {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7}};
constexpr Side tet_sides[] = {{0, 1}, {1, 2}, {2, 0}, {3, 0}, {3, 2}, {3, 1}};

constexpr CornerFace hex_faces[] = {{0, 3, 2, 1}, {0, 1, 5, 4}, {0, 4, 7, 3}, {1, 2, 6, 5}, {2, 3, 7, 6}, {4, 5, 6, 7}};
constexpr CornerFace wedge_faces[] = {{0, 2, 1, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {0, 3, 5, 2}, {1, 2, 5, 4}};
constexpr CornerFace tet_faces[] = {{0, 2, 1, -1}, {0, 1, 3, -1}, {0, 3, 2, -1}, {3, 1, 2, -1}};

constexpr std::array<int, 8> hex_mirror = {0, 3, 2, 1, 4, 7, 6, 5}, wedge_mirror = {0, 2, 1, 3, 5, 4},
                             tet_mirror = {0, 2, 1, 3}, quad_mirror = {0, 3, 2, 1}, triangle_mirror = {0, 2, 1};

struct Topology
{
  Shape shape;
  int gmsh_type;
  int corners;
  std::array<int, 8> mirrored_corners;
  std::span<const Side> mid_sides;
  std::span<const CornerFace> faces;
};

constexpr Topology topologies[] = {
    {Shape::hex8, 5, 8, hex_mirror, {}, hex_faces},       {Shape::hex20, 17, 8, hex_mirror, hex_sides, hex_faces},
    {Shape::wedge6, 6, 6, wedge_mirror, {}, wedge_faces}, {Shape::tet10, 11, 4, tet_mirror, tet_sides, tet_faces},
    {Shape::tet4, 4, 4, tet_mirror, {}, tet_faces},       {Shape::shell4, 3, 4, quad_mirror, {}, {}},
    {Shape::shell3, 2, 3, triangle_mirror, {}, {}},
};

struct FaceTopology
{
  FaceShape shape;
  int gmsh_type;
  int corners;
  int nodes;
  std::array<int, 8> mirrored;
};

constexpr FaceTopology face_topologies[] = {
    {FaceShape::triangle3, 2, 3, 3, {0, 2, 1}},
    {FaceShape::quad4, 3, 4, 4, {0, 3, 2, 1}},
    {FaceShape::triangle6, 9, 3, 6, {0, 2, 1, 5, 4, 3}},
    {FaceShape::quad8, 16, 4, 8, {0, 3, 2, 1, 7, 6, 5, 4}},
};

const Topology& topology(Shape shape)
{
  return *std::ranges::find(topologies, shape, &Topology::shape);
}

const FaceTopology& topology(FaceShape shape)
{
  return *std::ranges::find(face_topologies, shape, &FaceTopology::shape);
}

} // namespace

std::optional<Shape> element_shape(int gmsh_type)
{
  const auto found = std::ranges::find(topologies, gmsh_type, &Topology::gmsh_type);
  if (found == std::end(topologies)) return {};
  return found->shape;
}

std::optional<FaceShape> face_shape(int gmsh_type)
{
  const auto found = std::ranges::find(face_topologies, gmsh_type, &FaceTopology::gmsh_type);
  if (found == std::end(face_topologies)) return {};
  return found->shape;
}

int node_count(Shape shape)
{
  return corner_count(shape) + static_cast<int>(mid_sides(shape).size());
}

int node_count(FaceShape shape)
{
  return topology(shape).nodes;
}

int corner_count(Shape shape)
{
  return topology(shape).corners;
}

int corner_count(FaceShape shape)
{
  return topology(shape).corners;
}

bool is_shell(Shape shape)
{
  return topology(shape).faces.empty();
}

std::span<const int> nodes_of(const Element& element)
{
  return std::span(element.nodes).first(node_count(element.shape));
}

std::span<const int> nodes_of(const Face& face)
{
  return std::span(face.nodes).first(node_count(face.shape));
}

std::vector<Vec3> positions_of(const Mesh& mesh, const Element& element)
{
  std::vector<Vec3> x;
  for (const int node : nodes_of(element)) x.push_back(mesh.nodes[static_cast<std::size_t>(node)]);
  return x;
}

std::span<const std::array<int, 2>> mid_sides(Shape shape)
{
  return topology(shape).mid_sides;
}

std::span<const std::array<int, 4>> corner_faces(Shape shape)
{
  return topology(shape).faces;
}

std::vector<int> mirrored_order(Shape shape)
{
  const Topology& t = topology(shape);
  std::vector<int> order(t.mirrored_corners.begin(), t.mirrored_corners.begin() + t.corners);
  for (const auto& [a, b] : t.mid_sides)
  {
    const int from = order[a], to = order[b];
    const auto side = std::ranges::find_if(t.mid_sides, [&](const Side& s)
                                           { return (s[0] == from && s[1] == to) || (s[0] == to && s[1] == from); });
    order.push_back(t.corners + static_cast<int>(side - t.mid_sides.begin()));
  }
  return order;
}

std::vector<int> mirrored_order(FaceShape shape)
{
  const FaceTopology& t = topology(shape);
  return {t.mirrored.begin(), t.mirrored.begin() + t.nodes};
}

} // namespace squeal
