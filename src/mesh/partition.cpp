/// Partition of the mesh by METIS (Karypis and Kumar 1998).
///
/// Graph: two nodes are neighbours when an element has both. A contact pair's slave node and its master node of largest
/// weight are merged into one vertex. So both have the same owner. The weight of a vertex is the number of
/// its nodal degrees of freedom.
#include "squeal/mesh/contact_pairs.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <boost/pending/disjoint_sets.hpp>
#include <metis.h>
#include <numeric>

namespace squeal
{

namespace
{

struct Vertices
{
  std::vector<int> of_node;
  int count = 0;
};

/// Merges the two heaviest nodes of each pair, and of pairs that share one, into one vertex.
Vertices merge_pairs(std::size_t nodes, const std::vector<ContactPair>& pairs)
{
  boost::disjoint_sets_with_storage<> sets(nodes);
  for (const ContactPair& pair : pairs) sets.union_set(pair.rotor_node, pair.stator_node);
  Vertices vertices;
  std::vector<int> of_set(nodes, -1);
  for (std::size_t node = 0; node < nodes; ++node)
  {
    int& vertex = of_set[sets.find_set(node)];
    vertices.of_node.push_back(vertex < 0 ? vertex = vertices.count++ : vertex);
  }
  return vertices;
}

/// Adjacency in compressed rows, as METIS takes it.
struct Graph
{
  std::vector<idx_t> offsets, neighbours, weights;
};

Graph node_graph(const Mesh& mesh, const Vertices& vertices)
{
  std::vector<int> dofs(mesh.nodes.size(), 3);
  std::vector<std::vector<int>> elements_of(vertices.count);
  for (std::size_t e = 0; e < mesh.elements.size(); ++e)
    for (const int node : nodes_of(mesh.elements[e]))
    {
      if (is_shell(mesh.elements[e].shape)) dofs[node] = 6;
      elements_of[vertices.of_node[node]].push_back(static_cast<int>(e));
    }
  Graph graph;
  graph.weights.assign(vertices.count, 0);
  for (std::size_t i = 0; i < dofs.size(); ++i) graph.weights[vertices.of_node[i]] += dofs[i];
  graph.offsets = {0};
  std::vector<idx_t> neighbours;
  for (int v = 0; v < vertices.count; ++v)
  {
    neighbours.clear();
    for (const int e : elements_of[v])
      for (const int node : nodes_of(mesh.elements[e]))
        if (const int other = vertices.of_node[node]; other != v) neighbours.push_back(other);
    std::sort(neighbours.begin(), neighbours.end());
    graph.neighbours.insert(graph.neighbours.end(), neighbours.begin(),
                            std::unique(neighbours.begin(), neighbours.end()));
    graph.offsets.push_back(static_cast<idx_t>(graph.neighbours.size()));
  }
  return graph;
}

/// Returns the owner of each vertex. Each rank owns at least one vertex; `graph` must have as many.
std::vector<int> partition_graph(Graph graph, int ranks)
{
  idx_t vertices = static_cast<idx_t>(graph.weights.size()), constraints = 1, parts = ranks, cut = 0;
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = 1; // the same partition on every run
  std::vector<idx_t> part(graph.weights.size());
  const Finally waiting = without_sigterm();
  if (METIS_PartGraphKway(&vertices, &constraints, graph.offsets.data(), graph.neighbours.data(), graph.weights.data(),
                          nullptr, nullptr, &parts, nullptr, nullptr, options, &cut, part.data()) != METIS_OK)
    throw Error("METIS could not partition the mesh into " + std::to_string(ranks) + " parts");
  std::vector<int> rank(part.begin(), part.end());
  for (int r = 0; r < ranks; ++r)
    if (std::find(rank.begin(), rank.end(), r) == rank.end()) // METIS may leave a rank empty on a small graph
    {
      for (idx_t v = 0; v < vertices; ++v) rank[v] = static_cast<int>(v * ranks / vertices);
      break;
    }
  return rank;
}

} // namespace

Partition partition_mesh(const Mesh& mesh, const std::vector<ContactPair>& pairs, int ranks)
{
  Partition partition{std::vector<int>(mesh.nodes.size())};
  if (ranks == 1) return partition;
  const std::size_t nodes = mesh.nodes.size();
  if (nodes < static_cast<std::size_t>(ranks))
    throw Error(std::to_string(ranks) + " ranks are too many for a model of " + std::to_string(nodes) +
                " nodes: use at most " + std::to_string(nodes));
  const Vertices vertices = merge_pairs(nodes, pairs);
  std::vector<int> owner(vertices.count);
  std::iota(owner.begin(), owner.end(), 0); // used as it is where pairs leave fewer vertices than ranks
  if (vertices.count >= ranks) owner = partition_graph(node_graph(mesh, vertices), ranks);
  for (std::size_t i = 0; i < nodes; ++i) partition.node_rank[i] = owner[vertices.of_node[i]];
  return partition;
}

} // namespace squeal
