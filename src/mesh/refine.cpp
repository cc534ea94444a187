/// Division of every element into similar ones: lines in 2, faces in 4, solids in 8.
///
/// A corner's child is the element shrunk to half its size about that corner. Boxes consist of these; simplices and
/// wedges leave the middle, which other children fill (Bey, Computing 55 (1995) 355). A tetrahedron's middle, an
/// octahedron, is divided along its shortest diagonal.
///
/// A new node lies where the parent's shape functions N put it, x = sum of N_i x_i, also on curved sides. Its N is zero
/// but for nodes of the corner, side or face that it is on, so neighbours agree on the same N_i, which name the node.
/// All N are multiples of powers of two, hence exact. Caveat: a geometry's curvature beyond the element's own is not
/// found again.
#include "squeal/base/error.hpp"
#include "squeal/base/free_memory.hpp"
#include "squeal/mesh/mesh_file.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/mesh/shapes.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

namespace squeal
{

namespace
{

using Eigen::Vector3d;
using Places = std::vector<Vector3d>; // natural coordinates

/// gmsh's numbers of the lines of 2 and 3 nodes. Each is the first side of a quadrangle: nodes 0, 1 and 4.
constexpr int line2 = 1, line3 = 8;

/// Forms of elements, whatever their order. Simplices have their corners at 0 and at unit vectors.
enum class Form
{
  line,
  triangle,
  quadrangle,
  tetrahedron,
  hexahedron,
  wedge,
};

/// An element type of the file.
struct CellType
{
  Form form{};
  std::vector<std::array<int, 2>> sides{}; // with mid-side nodes, in their order
  std::function<NodeValues(const Vector3d&)> values{};
};

std::optional<CellType> cell_type(int gmsh_type)
{
  const auto of_face = [](FaceShape shape)
  { return [shape](const Vector3d& xi) { return shape_functions(shape, xi).N; }; };
  const auto on_line = [](FaceShape quad, std::vector<int> nodes) {
    return [=](const Vector3d& xi) -> NodeValues { return shape_functions(quad, {xi(0), -1, 0}).N(nodes); };
  };
  switch (gmsh_type)
  {
  case line2:
    return CellType{Form::line, {}, on_line(FaceShape::quad4, {0, 1})};
  case line3:
    return CellType{Form::line, {{0, 1}}, on_line(FaceShape::quad8, {0, 1, 4})};
  default:
    break;
  }
  if (const auto face = face_shape(gmsh_type))
  {
    const int corners = corner_count(*face);
    CellType type{corners == 3 ? Form::triangle : Form::quadrangle, {}, of_face(*face)};
    if (node_count(*face) > corners)
      for (int i = 0; i < corners; ++i) type.sides.push_back({i, (i + 1) % corners});
    return type;
  }
  const auto shape = element_shape(gmsh_type);
  if (!shape) return std::nullopt;
  const auto sides = mid_sides(*shape);
  const int corners = corner_count(*shape);
  return CellType{corners == 8   ? Form::hexahedron
                  : corners == 6 ? Form::wedge
                                 : Form::tetrahedron,
                  {sides.begin(), sides.end()},
                  [shape = *shape](const Vector3d& xi) { return shape_functions(shape, xi).N; }};
}

Places corners_of(Form form)
{
  switch (form)
  {
  case Form::line:
    return {{-1, 0, 0}, {1, 0, 0}};
  case Form::triangle:
    return {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  case Form::quadrangle:
    return {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  case Form::tetrahedron:
    return {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  case Form::hexahedron:
    return {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}};
  default:
    return {{0, 0, -1}, {1, 0, -1}, {0, 1, -1}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  }
}

/// Corners of an octahedron that are opposite each other, by the tetrahedron's sides that they halve.
constexpr std::array<std::array<std::array<int, 2>, 2>, 3> diagonals = {
    {{{{0, 1}, {2, 3}}}, {{{0, 2}, {1, 3}}}, {{{0, 3}, {1, 2}}}}};

/// Corners of the children that fill the middle. `diagonal`: of a tetrahedron's.
std::vector<Places> middle_children(Form form, const Places& c, std::size_t diagonal)
{
  const auto half = [&](std::array<int, 2> side) -> Vector3d { return (c[side[0]] + c[side[1]]) / 2; };
  const auto at_height = [](Vector3d place, double z) -> Vector3d { return {place(0), place(1), z}; };
  const Places triangle =
      form == Form::triangle || form == Form::wedge ? Places{half({0, 1}), half({1, 2}), half({2, 0})} : Places{};
  std::vector<Places> children;
  if (form == Form::triangle) children.push_back(triangle);
  if (form == Form::wedge)
    for (const double bottom : {-1., 0.})
    {
      Places& child = children.emplace_back();
      for (const double z : {bottom, bottom + 1})
        for (const Vector3d& place : triangle) child.push_back(at_height(place, z));
    }
  if (form == Form::tetrahedron)
  {
    const auto& [from, to] = diagonals[diagonal];
    const auto& [a, b] = diagonals[(diagonal + 1) % 3];
    const auto& [d, e] = diagonals[(diagonal + 2) % 3];
    const Places ring = {half(a), half(d), half(b), half(e)};
    for (std::size_t i = 0; i < 4; ++i) children.push_back({half(from), half(to), ring[i], ring[(i + 1) % 4]});
  }
  return children;
}

/// Weights of an element's nodes.
using LocalWeights = std::vector<std::pair<std::size_t, double>>;

/// The nodes of each child.
using Children = std::vector<std::vector<LocalWeights>>;

Children children_of(const CellType& type, std::size_t diagonal)
{
  const Places corners = corners_of(type.form);
  std::vector<Places> all;
  for (const Vector3d& about : corners)
    for (Places& child = all.emplace_back(); const Vector3d& corner : corners) child.push_back((corner + about) / 2);
  for (Places& child : middle_children(type.form, corners, diagonal)) all.push_back(std::move(child));
  Children children;
  for (Places& places : all)
  {
    for (const auto& [a, b] : type.sides) places.push_back((places[a] + places[b]) / 2);
    for (auto& child = children.emplace_back(); const Vector3d& place : places)
    {
      LocalWeights& weights = child.emplace_back();
      const NodeValues N = type.values(place);
      for (Eigen::Index i = 0; i < N.size(); ++i)
        if (N(i) != 0) weights.emplace_back(i, N(i));
    }
  }
  return children;
}

/// The shortest diagonal of the octahedron within a tetrahedron; 0 of other elements.
std::size_t shortest_diagonal(Form form, std::span<const int> nodes, const std::vector<Vec3>& places)
{
  if (form != Form::tetrahedron) return 0;
  const auto at = [&](int corner) { return places[static_cast<std::size_t>(nodes[static_cast<std::size_t>(corner)])]; };
  const auto length = [&](const auto& diagonal)
  {
    const auto& [from, to] = diagonal;
    return norm(at(from[0]) + at(from[1]) - at(to[0]) - at(to[1]));
  };
  return static_cast<std::size_t>(std::ranges::min_element(diagonals, {}, length) - diagonals.begin());
}

/// Numbers the nodes of children: those that are there, then new ones as they come.
class NewNodes
{
public:
  explicit NewNodes(FileMesh& mesh) : mesh_(mesh) {}

  int number_of(std::span<const int> nodes, const LocalWeights& local)
  {
    NodeWeights weights;
    for (const auto& [i, weight] : local) weights.emplace_back(nodes[i], weight);
    if (weights.size() == 1) return weights.front().first;
    std::ranges::sort(weights);
    const auto [place, is_new] = numbers_.emplace(weights, static_cast<int>(mesh_.nodes.size()));
    if (!is_new) return place->second;
    Vec3 at{};
    for (const auto& [node, weight] : weights) at = at + weight * mesh_.nodes[static_cast<std::size_t>(node)];
    mesh_.nodes.push_back(at);
    mesh_.parents.push_back(std::move(weights));
    return place->second;
  }

private:
  FileMesh& mesh_;
  std::map<NodeWeights, int> numbers_{};
};

void divide(ElementBlock& block, const CellType& type, NewNodes& numbers, const std::vector<Vec3>& places)
{
  std::vector<Children> children;
  for (std::size_t d = 0; d < (type.form == Form::tetrahedron ? diagonals.size() : 1); ++d)
    children.push_back(children_of(type, d));
  const auto n = static_cast<std::size_t>(block.nodes_per_element);
  const std::vector<int> parents = std::move(block.nodes);
  block.nodes = {};
  for (std::size_t first = 0; first < parents.size(); first += n)
  {
    const std::span nodes = std::span(parents).subspan(first, n);
    for (const auto& child : children[shortest_diagonal(type.form, nodes, places)])
      for (const LocalWeights& weights : child) block.nodes.push_back(numbers.number_of(nodes, weights));
  }
}

} // namespace

void refine(FileMesh& mesh, int times)
{
  constexpr double bytes_a_node = 3 * (3 * 81) * 12; // M, C and K of bricks, on all ranks together
  const double finer = std::pow(8, times);           // nodes and elements for each one
  std::size_t entries = 6 * mesh.nodes.size();       // degrees of freedom
  for (const ElementBlock& block : mesh.blocks) entries = std::max(entries, block.nodes.size());
  const double nodes = finer * static_cast<double>(mesh.nodes.size()), free = free_memory(MPI_COMM_SELF);
  if (times > 0 &&
      (finer * static_cast<double>(entries) > std::numeric_limits<int>::max() || nodes * bytes_a_node > free))
    throw Error(
        format("mesh.refine = %d would divide %zu nodes into about %.2g, whose matrices take %.2g GB where %.2g "
               "GB are free: give a smaller one",
               times, mesh.nodes.size(), nodes, 1e-9 * nodes * bytes_a_node, 1e-9 * free));
  for (int i = 0; i < times; ++i)
  {
    mesh.parents.clear();
    NewNodes numbers(mesh);
    for (ElementBlock& block : mesh.blocks)
      if (const auto type = cell_type(block.type)) divide(block, *type, numbers, mesh.nodes);
  }
}

} // namespace squeal
