/// Division of every element: lines in 2, faces in 4, solids in 8, pyramids in 6 of their kind and 4 tetrahedra.
///
/// A corner's child is the element shrunk to half its size about that corner. Boxes consist of these; the others leave
/// the middle, which other children fill (Bey, Computing 55 (1995) 355). A tetrahedron's middle, an octahedron, is
/// divided along its shortest diagonal. A pyramid's holds one that stands on its apex, and a tetrahedron at each side.
///
/// A new node lies where the parent's shape functions N put it, x = sum of N_i x_i, also on curved sides. Its N is zero
/// but for nodes of the corner, side or face that it is on. So neighbours agree on the same N_i, which name the node.
/// All N are multiples of powers of two, hence exact, but within a pyramid. The middles of straight edges and faces
/// that gmsh meshed on a curved geometry lie on it instead. Caveat: in the first division alone.
#include "squeal/base/error.hpp"
#include "squeal/base/free_memory.hpp"
#include "squeal/mesh/mesh_file.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <ranges>

namespace squeal
{

namespace
{

using Eigen::Vector3d;

using Pair = std::array<int, 2>;

/// The corners of a child, each in the middle of two of the parent's, which may be one.
using Child = std::vector<Pair>;

/// Corners of an octahedron that are opposite each other, by the tetrahedron's sides that they halve.
constexpr std::array<std::array<Pair, 2>, 3> diagonals = {{{{{0, 1}, {2, 3}}}, {{{0, 2}, {1, 3}}}, {{{0, 3}, {1, 2}}}}};

/// Children beside those of the corners.
using Middle = std::vector<Child>;

/// The children at the middle of a shape; a tetrahedron is divided by the diagonal.
std::vector<Middle> middle_children(Shape shape)
{
  const Child triangle = {{0, 1}, {1, 2}, {2, 0}}, lower = {{0, 1}, {1, 2}, {2, 0}, {0, 4}, {1, 5}, {2, 3}},
              upper = {{0, 4}, {1, 5}, {2, 3}, {3, 4}, {4, 5}, {5, 3}};
  const int corners = corner_count(shape), dimension = dimension_of(shape);
  if (corners == 3) return {Middle{triangle}};
  if (corners == 6) return {Middle{lower, upper}};
  if (corners == 5)
    return {Middle{{{0, 4}, {3, 4}, {2, 4}, {1, 4}, {0, 2}},
                   {{0, 1}, {0, 4}, {1, 4}, {0, 2}},
                   {{1, 2}, {1, 4}, {2, 4}, {0, 2}},
                   {{2, 3}, {2, 4}, {3, 4}, {0, 2}},
                   {{3, 0}, {3, 4}, {0, 4}, {0, 2}}}};
  if (corners != 4 || dimension != 3) return {Middle{}};
  std::vector<Middle> middles;
  for (std::size_t d = 0; d < 3; ++d)
  {
    const auto& [from, to] = diagonals[d];
    const auto& [a, b] = diagonals[(d + 1) % 3];
    const auto& [c, e] = diagonals[(d + 2) % 3];
    const std::array ring = {a, c, b, e};
    Middle& octahedron = middles.emplace_back();
    for (std::size_t i = 0; i < 4; ++i) octahedron.push_back({from, to, ring[i], ring[(i + 1) % 4]});
  }
  return middles;
}

/// Weights of an element's nodes.
using LocalWeights = std::vector<std::pair<std::size_t, double>>;

struct ChildElement
{
  Shape shape{};
  std::vector<LocalWeights> nodes{};
};

using Children = std::vector<ChildElement>;

Children children_of(Shape shape, const Middle& middle)
{
  const int corners = corner_count(shape);
  const std::vector<Vector3d> parent = natural_positions(shape);
  Middle all;
  for (int about = 0; about < corners; ++about)
    for (Child& child = all.emplace_back(); const int corner : std::views::iota(0, corners))
      child.push_back({corner, about});
  all.insert(all.end(), middle.begin(), middle.end());
  Children children;
  for (const Child& child : all)
  {
    std::vector<Vector3d> places; // natural coordinates
    for (const auto& [a, b] : child) places.emplace_back((parent[a] + parent[b]) / 2);
    ChildElement& element = children.emplace_back(shape);
    if (corners == 5 && child.size() == 4) element.shape = middles_of(shape).empty() ? Shape::tet4 : Shape::tet10;
    add_middles(element.shape, places);
    for (const Vector3d& place : places)
    {
      LocalWeights& weights = element.nodes.emplace_back();
      const NodeValues N = shape_functions(shape, place).N;
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
    if (const auto middle = mesh_.middles.find(weights); middle != mesh_.middles.end()) at = middle->second;
    mesh_.nodes.push_back(at);
    mesh_.parents.push_back(std::move(weights));
    return place->second;
  }

private:
  FileMesh& mesh_;
  std::map<NodeWeights, int> numbers_{};
};

/// Returns blocks of the children, one of each shape.
std::vector<ElementBlock> divided(const ElementBlock& block, Shape shape, NewNodes& numbers,
                                  const std::vector<Vec3>& places)
{
  std::vector<Children> children;
  for (const Middle& middle : middle_children(shape)) children.push_back(children_of(shape, middle));
  std::map<Shape, ElementBlock> blocks;
  const auto n = static_cast<std::size_t>(block.nodes_per_element);
  for (std::size_t first = 0; first < block.nodes.size(); first += n)
  {
    const std::span nodes = std::span(block.nodes).subspan(first, n);
    for (const ChildElement& child : children[children.size() == 1 ? 0 : shortest_diagonal(nodes, places)])
    {
      const ElementBlock empty{block.dimension, gmsh_type(child.shape), block.type_name, node_count(child.shape), {},
                               block.groups};
      std::vector<int>& its = blocks.try_emplace(child.shape, empty).first->second.nodes;
      for (const LocalWeights& weights : child.nodes) its.push_back(numbers.number_of(nodes, weights));
    }
  }
  std::vector<ElementBlock> result;
  for (auto& [of, its] : blocks) result.push_back(std::move(its));
  return result;
}

} // namespace

void refine(FileMesh& mesh, int times)
{
  constexpr double bytes_a_node = 3 * (3 * 81) * 12; // M, C and K of bricks, on all ranks together
  const double nodes = std::pow(8, times) * static_cast<double>(mesh.nodes.size()), free = free_memory(MPI_COMM_SELF);
  if (times > 0 && nodes * bytes_a_node > free)
    throw Error(
        format("mesh.refine = %d would divide %zu nodes into about %.2g, whose matrices take %.2g GB where %.2g "
               "GB are free: give a smaller one",
               times, mesh.nodes.size(), nodes, 1e-9 * nodes * bytes_a_node, 1e-9 * free));
  for (int i = 0; i < times; ++i)
  {
    mesh.parents.clear();
    NewNodes numbers(mesh);
    std::vector<ElementBlock> blocks;
    for (ElementBlock& block : mesh.blocks)
      if (const auto shape = shape_of(block.type))
        std::ranges::move(divided(block, *shape, numbers, mesh.nodes), std::back_inserter(blocks));
      else
        blocks.push_back(std::move(block));
    mesh.blocks = std::move(blocks);
  }
}

} // namespace squeal
