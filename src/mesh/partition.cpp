/// METIS (Karypis and Kumar 1998) on the node graph: two nodes are neighbours when an element has both. The nodes of a
/// contact pair are one vertex, so that no pair straddles ranks. A vertex weighs its degrees of freedom.
#include "squeal/base/error.hpp"
#include "squeal/mesh/shapes.hpp"

#include <algorithm>
#include <metis.h>
#include <numeric>

namespace squeal
{

namespace
{

// Vertex of every node: nodes of a pair, and of pairs that share a node, have one.
std::vector<int> merge_pairs(std::size_t nodes, const std::vector<NodePair>& pairs, int& vertices)
{
  std::vector<int> parent(nodes);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int node)
  {
    while (parent[node] != node) node = parent[node] = parent[parent[node]];
    return node;
  };
  for (const NodePair& pair : pairs)
  {
    const int a = root(pair.a), b = root(pair.b);
    parent[std::max(a, b)] = std::min(a, b);
  }
  std::vector<int> vertex(nodes);
  vertices = 0;
  for (std::size_t i = 0; i < nodes; ++i) // a root comes before the nodes that hang on it
    vertex[i] = root(static_cast<int>(i)) == static_cast<int>(i) ? vertices++ : vertex[root(static_cast<int>(i))];
  return vertex;
}

struct Graph
{
  std::vector<idx_t> offsets, neighbours, weights;
};

Graph node_graph(const Mesh& mesh, const std::vector<int>& vertex, int vertices)
{
  std::vector<int> dofs(mesh.nodes.size(), 3);
  std::vector<std::vector<int>> elements_of(vertices);
  for (std::size_t e = 0; e < mesh.elements.size(); ++e)
  {
    const Element& element = mesh.elements[e];
    for (int i = 0; i < node_count(element.shape); ++i)
    {
      if (is_shell(element.shape)) dofs[element.nodes[i]] = 6;
      elements_of[vertex[element.nodes[i]]].push_back(static_cast<int>(e));
    }
  }
  Graph graph;
  graph.weights.assign(vertices, 0);
  for (std::size_t i = 0; i < vertex.size(); ++i) graph.weights[vertex[i]] += dofs[i];
  graph.offsets = {0};
  std::vector<idx_t> around;
  for (int v = 0; v < vertices; ++v)
  {
    around.clear();
    for (const int e : elements_of[v])
      for (int i = 0; i < node_count(mesh.elements[e].shape); ++i)
      {
        const int other = vertex[mesh.elements[e].nodes[i]];
        if (other != v) around.push_back(other);
      }
    std::sort(around.begin(), around.end());
    graph.neighbours.insert(graph.neighbours.end(), around.begin(), std::unique(around.begin(), around.end()));
    graph.offsets.push_back(static_cast<idx_t>(graph.neighbours.size()));
  }
  return graph;
}

std::vector<int> split(Graph graph, int ranks)
{
  idx_t vertices = static_cast<idx_t>(graph.weights.size()), constraints = 1, parts = ranks, cut = 0;
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = 1; // the same partition on every run
  std::vector<idx_t> part(graph.weights.size());
  const int code =
      METIS_PartGraphKway(&vertices, &constraints, graph.offsets.data(), graph.neighbours.data(), graph.weights.data(),
                          nullptr, nullptr, &parts, nullptr, nullptr, options, &cut, part.data());
  if (code != METIS_OK) throw Error("METIS could not split the mesh into " + std::to_string(ranks) + " parts");
  std::vector<int> rank(part.begin(), part.end());
  for (int r = 0; r < ranks; ++r)
    if (std::find(rank.begin(), rank.end(), r) == rank.end()) // METIS leaves ranks empty on tiny graphs
    {
      for (idx_t v = 0; v < vertices; ++v) rank[v] = static_cast<int>(v * ranks / vertices);
      break;
    }
  return rank;
}

int most_frequent(std::vector<int> values)
{
  std::sort(values.begin(), values.end());
  int best = values.front();
  std::ptrdiff_t most = 0;
  for (auto it = values.begin(); it != values.end();)
  {
    const auto end = std::upper_bound(it, values.end(), *it);
    if (end - it > most) most = end - it, best = *it;
    it = end;
  }
  return best;
}

} // namespace

Partition partition_mesh(const Mesh& mesh, const std::vector<NodePair>& pairs, MPI_Comm comm)
{
  int ranks = 1;
  MPI_Comm_size(comm, &ranks);
  Partition partition{std::vector<int>(mesh.nodes.size()), std::vector<int>(mesh.elements.size())};
  if (ranks == 1) return partition;
  const std::size_t nodes = mesh.nodes.size();
  if (nodes < static_cast<std::size_t>(ranks))
    throw Error(std::to_string(ranks) + " ranks are too many for a model of " + std::to_string(nodes) +
                " nodes: use at most " + std::to_string(nodes));
  int vertices = 0;
  const std::vector<int> vertex = merge_pairs(nodes, pairs, vertices);
  std::vector<int> vertex_rank(vertices);
  std::iota(vertex_rank.begin(), vertex_rank.end(), 0); // stands where pairs leave fewer vertices than ranks
  if (vertices >= ranks) on_rank_zero(comm, [&] { vertex_rank = split(node_graph(mesh, vertex, vertices), ranks); });
  MPI_Bcast(vertex_rank.data(), vertices, MPI_INT, 0, comm);
  for (std::size_t i = 0; i < vertex.size(); ++i) partition.node_rank[i] = vertex_rank[vertex[i]];
  for (std::size_t e = 0; e < mesh.elements.size(); ++e)
  {
    const Element& element = mesh.elements[e];
    std::vector<int> owners;
    for (int i = 0; i < node_count(element.shape); ++i) owners.push_back(partition.node_rank[element.nodes[i]]);
    partition.element_rank[e] = most_frequent(owners);
  }
  return partition;
}

} // namespace squeal
