/// A superelement's retained nodes are those of the mesh at the same places. Its modal coordinates are carried by nodes
/// of its own, six a node.
#include "superelements.hpp"

#include "squeal/base/error.hpp"
#include "squeal/mesh/names.hpp"
#include "squeal/mesh/row_motions.hpp"

#include <algorithm>
#include <set>

namespace squeal
{

namespace
{

double size_of(const std::vector<Vec3>& nodes)
{
  Vec3 low = nodes.front(), high = nodes.front();
  for (const Vec3& node : nodes)
    for (std::size_t c = 0; c < 3; ++c)
    {
      low[c] = std::min(low[c], node[c]);
      high[c] = std::max(high[c], node[c]);
    }
  return norm(high - low);
}

/// The node of the mesh, among the candidates, where a retained node is.
int joined_node(const Mesh& mesh, const std::set<int>& candidates, const PlacedNode& retained, const std::string& user)
{
  constexpr double coincident = 1e-6; // of the mesh's size: places in a mesh file have as many digits
  const auto distance = [&](int node) { return norm(mesh.nodes[static_cast<std::size_t>(node)] - retained.at); };
  const int nearest =
      *std::min_element(candidates.begin(), candidates.end(), [&](int a, int b) { return distance(a) < distance(b); });
  if (distance(nearest) > coincident * size_of(mesh.nodes))
    throw Error(
        user + ": node " + std::to_string(retained.node) +
        format(" at (%g, %g, %g) m meets no node: the nearest is %.3g m away; mesh the parts so that their nodes "
               "coincide with the retained ones, or name the point or group that has them",
               retained.at[0], retained.at[1], retained.at[2], distance(nearest)));
  return nearest;
}

/// The node of the mesh for each retained node.
std::map<long, int> joined_nodes(const Mesh& mesh, const Superelement& superelement,
                                 const std::vector<PlacedNode>& placed, const std::vector<NodeMotion>& rows)
{
  const std::string user = "superelement " + superelement.name;
  std::set<int> candidates, taken;
  for (const std::string& name : superelement.on)
    for (const int node : named_nodes(mesh, name, user)) candidates.insert(node);
  if (candidates.empty()) throw Error(user + ": the groups that it is joined to have no nodes");
  std::map<long, int> joined;
  for (const NodeMotion& row : rows)
  {
    if (row.motion < 0 || joined.count(row.node)) continue;
    const auto place = std::ranges::find(placed, row.node, &PlacedNode::node);
    if (place == placed.end())
      throw Error(user + ": nodes.txt has no line for node " + std::to_string(row.node) + " of dofs.txt");
    const int node = joined_node(mesh, candidates, *place, user);
    if (!taken.insert(node).second)
      throw Error(user + ": two of its nodes, one of them " + std::to_string(row.node) + ", are at the same place");
    joined[row.node] = node;
  }
  if (joined.empty()) throw Error(user + ": dofs.txt has no motion of a node, so there is nothing to join");
  return joined;
}

} // namespace

void add_superelements(const Scene& scene, Mesh& mesh)
{
  for (const Superelement& superelement : scene.superelements)
  {
    const std::vector<NodeMotion> rows = read_row_motions(superelement.folder / "dofs.txt");
    const std::vector<PlacedNode> placed = read_placed_nodes(superelement.folder / "nodes.txt");
    const auto joined = joined_nodes(mesh, superelement, placed, rows);
    std::vector<SuperelementRow> own;
    int coordinates = 0;
    for (const NodeMotion& row : rows)
    {
      if (row.motion >= 0)
      {
        own.push_back({joined.at(row.node), row.motion, false});
        continue;
      }
      if (coordinates % 6 == 0) mesh.nodes.push_back(placed.front().at);
      own.push_back({static_cast<int>(mesh.nodes.size()) - 1, coordinates++ % 6, true});
    }
    mesh.superelements.push_back(std::move(own));
  }
}

} // namespace squeal
