#include "conformity.hpp"

#include "squeal/base/error.hpp"
#include "squeal/mesh/names.hpp"
#include "squeal/mesh/shapes.hpp"

#include <algorithm>
#include <tuple>

namespace squeal
{

namespace
{

struct CornerSet
{
  std::array<int, 8> nodes; // ascending, after -1 for corners that the shape does not have
  int element;
};

std::string named_part(const Element& element, const Scene& scene)
{
  return "part '" + scene.parts[element.part].name + "'";
}

void check_doubles(const Mesh& mesh, const Scene& scene)
{
  std::vector<CornerSet> sets;
  for (std::size_t e = 0; e < mesh.elements.size(); ++e)
  {
    const Element& element = mesh.elements[e];
    CornerSet set{{}, static_cast<int>(e)};
    set.nodes.fill(-1);
    std::copy_n(element.nodes.begin(), corner_count(element.shape), set.nodes.begin());
    std::sort(set.nodes.begin(), set.nodes.end());
    sets.push_back(set);
  }
  std::sort(sets.begin(), sets.end(), [](const CornerSet& a, const CornerSet& b) { return a.nodes < b.nodes; });
  const auto twin = std::adjacent_find(sets.begin(), sets.end(),
                                       [](const CornerSet& a, const CornerSet& b) { return a.nodes == b.nodes; });
  if (twin == sets.end()) return;
  const Element &first = mesh.elements[twin->element], &second = mesh.elements[(twin + 1)->element];
  throw Error(named_part(first, scene) + " and " + named_part(second, scene) +
              " have two elements on the same nodes, at " + node_text(first.nodes[0], mesh.nodes[first.nodes[0]]) +
              ": the body would count twice there. Remove one from the mesh");
}

/// An edge of a solid element, between two corners. Mid-sides on edges of shells follow them (squeal/mesh/ties.hpp).
struct Edge
{
  int low, high; // its corners
  int middle;    // its mid-side node; -1 if it has none
  int element;
};

void add_edges(const Mesh& mesh, int index, std::vector<Edge>& edges)
{
  const Element& element = mesh.elements[index];
  const auto add = [&](int a, int b, int middle) { edges.push_back({std::min(a, b), std::max(a, b), middle, index}); };
  const auto sides = mid_sides(element.shape);
  const int corners = corner_count(element.shape);
  for (std::size_t k = 0; k < sides.size(); ++k)
    add(element.nodes[sides[k][0]], element.nodes[sides[k][1]], element.nodes[corners + k]);
  if (!sides.empty()) return;
  for (const auto& face : corner_faces(element.shape))
  {
    const int count = face[3] < 0 ? 3 : 4;
    for (int i = 0; i < count; ++i) add(element.nodes[face[i]], element.nodes[face[(i + 1) % count]], -1);
  }
}

void check_mid_sides(const Mesh& mesh, const Scene& scene)
{
  const auto has_mid_sides = [](const Element& element) { return !mid_sides(element.shape).empty(); };
  if (std::none_of(mesh.elements.begin(), mesh.elements.end(), has_mid_sides)) return;
  std::vector<Edge> edges;
  for (std::size_t e = 0; e < mesh.elements.size(); ++e) add_edges(mesh, static_cast<int>(e), edges);
  std::sort(edges.begin(), edges.end(),
            [](const Edge& a, const Edge& b)
            { return std::tie(a.low, a.high, a.middle) < std::tie(b.low, b.high, b.middle); });
  const auto hanging = [](const Edge& a, const Edge& b)
  { return a.low == b.low && a.high == b.high && a.middle != b.middle; };
  const auto found = std::adjacent_find(edges.begin(), edges.end(), hanging);
  if (found == edges.end()) return;
  const Edge& with = *(found + 1); // the larger middle: it has one
  throw Error(named_part(mesh.elements[with.element], scene) + " has the mid-side " +
              node_text(with.middle, mesh.nodes[with.middle]) + " on an edge that " +
              named_part(mesh.elements[found->element], scene) +
              " has without it: the bodies would part along the edge. Mesh both by elements of one order");
}

} // namespace

void check_conformity(const Mesh& mesh, const Scene& scene)
{
  check_doubles(mesh, scene);
  check_mid_sides(mesh, scene);
}

} // namespace squeal
