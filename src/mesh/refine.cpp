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
#include <ranges>

namespace squeal
{

namespace
{

using Eigen::Vector3d;
using Places = std::vector<Vector3d>; // natural coordinates

/// gmsh's numbers of the lines of 2 and 3 nodes. Each is the first side of a quadrangle: nodes 0, 1 and 4.
constexpr int line2 = 1, line3 = 8;

using Pair = std::array<int, 2>;

/// The corners of a child, each in the middle of two of the parent's, which may be one.
using Child = std::vector<Pair>;

/// An element type of the file.
struct CellType
{
  Places corners{};
  std::vector<Pair> sides{}; // with mid-side nodes, in their order
  std::function<NodeValues(const Vector3d&)> values{};
  std::vector<std::vector<Child>> middles{}; // children beside those of the corners; of a tetrahedron by the diagonal
};

/// Corners of an octahedron that are opposite each other, by the tetrahedron's sides that they halve.
constexpr std::array<std::array<Pair, 2>, 3> diagonals = {{{{{0, 1}, {2, 3}}}, {{{0, 2}, {1, 3}}}, {{{0, 3}, {1, 2}}}}};

std::vector<std::vector<Child>> middles_of(int corners, int dimension)
{
  const Child triangle = {{0, 1}, {1, 2}, {2, 0}}, lower = {{0, 1}, {1, 2}, {2, 0}, {0, 4}, {1, 5}, {2, 3}},
              upper = {{0, 4}, {1, 5}, {2, 3}, {3, 4}, {4, 5}, {5, 3}};
  std::vector<std::vector<Child>> middles;
  if (corners == 3) middles.push_back({triangle});
  if (corners == 6) middles.push_back({lower, upper});
  if (corners != 4 || dimension != 3) middles.resize(1);
  if (!middles.empty()) return middles;
  for (std::size_t d = 0; d < 3; ++d)
  {
    const auto& [from, to] = diagonals[d];
    const auto& [a, b] = diagonals[(d + 1) % 3];
    const auto& [c, e] = diagonals[(d + 2) % 3];
    const std::array ring = {a, c, b, e};
    std::vector<Child>& octahedron = middles.emplace_back();
    for (std::size_t i = 0; i < 4; ++i) octahedron.push_back({from, to, ring[i], ring[(i + 1) % 4]});
  }
  return middles;
}

std::optional<CellType> cell_type(int gmsh_type, int dimension)
{
  static const Places brick = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                               {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}},
                      simplex = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                      prism = {{0, 0, -1}, {1, 0, -1}, {0, 1, -1}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  CellType type;
  int corners = 2; // of a line
  if (gmsh_type == line2)
    type.values = [](const Vector3d& xi) -> NodeValues { return shape_functions(FaceShape::quad4, xi).N.head(2); };
  else if (gmsh_type == line3)
  {
    type.sides = {{0, 1}};
    type.values = [](const Vector3d& xi) -> NodeValues {
      return shape_functions(FaceShape::quad8, xi).N(std::array<Eigen::Index, 3>{0, 1, 4});
    };
  }
  else if (const auto face = face_shape(gmsh_type))
  {
    corners = corner_count(*face);
    for (int i = 0; i < node_count(*face) - corners; ++i) type.sides.push_back({i, (i + 1) % corners});
    type.values = [shape = *face](const Vector3d& xi) { return shape_functions(shape, xi).N; };
  }
  else if (const auto solid = element_shape(gmsh_type))
  {
    corners = corner_count(*solid);
    type.sides.assign(mid_sides(*solid).begin(), mid_sides(*solid).end());
    type.values = [shape = *solid](const Vector3d& xi) { return shape_functions(shape, xi).N; };
  }
  else
    return std::nullopt;
  const Places& whole = corners == 6 ? prism : corners == 3 || (corners == 4 && dimension == 3) ? simplex : brick;
  type.corners.assign(whole.begin(), whole.begin() + corners);
  type.middles = middles_of(corners, dimension);
  return type;
}

/// Weights of an element's nodes.
using LocalWeights = std::vector<std::pair<std::size_t, double>>;

/// The nodes of each child.
using Children = std::vector<std::vector<LocalWeights>>;

Children children_of(const CellType& type, const std::vector<Child>& middle)
{
  const auto corners = static_cast<int>(type.corners.size());
  std::vector<Child> all;
  for (int about = 0; about < corners; ++about)
    for (Child& child = all.emplace_back(); const int corner : std::views::iota(0, corners))
      child.push_back({corner, about});
  all.insert(all.end(), middle.begin(), middle.end());
  Children children;
  for (const Child& child : all)
  {
    Places places;
    for (const auto& [a, b] : child) places.push_back((type.corners[a] + type.corners[b]) / 2);
    for (const auto& [a, b] : type.sides) places.push_back((places[a] + places[b]) / 2);
    for (auto& nodes = children.emplace_back(); const Vector3d& place : places)
    {
      LocalWeights& weights = nodes.emplace_back();
      const NodeValues N = type.values(place);
      for (Eigen::Index i = 0; i < N.size(); ++i)
        if (N(i) != 0) weights.emplace_back(i, N(i));
    }
  }
  return children;
}

/// The shortest diagonal of the octahedron within a tetrahedron.
std::size_t shortest_diagonal(std::span<const int> nodes, const std::vector<Vec3>& places)
{
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
  for (const std::vector<Child>& middle : type.middles) children.push_back(children_of(type, middle));
  const auto n = static_cast<std::size_t>(block.nodes_per_element);
  const std::vector<int> parents = std::move(block.nodes);
  block.nodes = {};
  for (std::size_t first = 0; first < parents.size(); first += n)
  {
    const std::span nodes = std::span(parents).subspan(first, n);
    for (const auto& child : children[children.size() == 1 ? 0 : shortest_diagonal(nodes, places)])
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
      if (const auto type = cell_type(block.type, block.dimension)) divide(block, *type, numbers, mesh.nodes);
  }
}

} // namespace squeal
