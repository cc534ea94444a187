#include "symbolic_factor.hpp"

#include "squeal/algebra/panel.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/base/statistics.hpp"

#include <algorithm>
#include <metis.h>
#include <numeric>
#include <span>
#include <unordered_map>
#include <utility>

namespace squeal
{

namespace
{

/// A graph in compressed form: the neighbours of each node, one list after the other.
struct Graph
{
  std::vector<idx_t> offsets{0}, neighbours{};

  int nodes() const { return static_cast<int>(offsets.size()) - 1; }
  std::span<const idx_t> of(int node) const
  {
    return {neighbours.data() + offsets[at(node)], neighbours.data() + offsets[at(node + 1)]};
  }
};

/// The position of each node in METIS's nested dissection (Karypis and Kumar 1998). Error: METIS finds no order.
std::vector<idx_t> nested_dissection(Graph graph, std::vector<idx_t> weights)
{
  std::vector<idx_t> order(weights.size()), position(weights.size()), options(METIS_NOPTIONS);
  METIS_SetDefaultOptions(options.data());
  options[METIS_OPTION_COMPRESS] = 0; // the nodes are compressed
  idx_t size = graph.nodes();
  if (size == 0) return position;
  graph.neighbours.reserve(1); // METIS takes no null pointer
  const Finally waiting = without_sigterm();
  if (METIS_NodeND(&size, graph.offsets.data(), graph.neighbours.data(), weights.data(), options.data(), order.data(),
                   position.data()) != METIS_OK)
    throw LibraryError("METIS found no elimination order");
  return position;
}

/// The graph of (node, neighbour) pairs, each neighbour once and ascending; neighbours are less than `range`.
Graph graph_of(int nodes, int range, const std::vector<std::pair<int, int>>& edges)
{
  std::vector<std::size_t> starts(at(nodes) + 1, 0);
  for (const auto& edge : edges) ++starts[at(edge.first) + 1];
  std::partial_sum(starts.begin(), starts.end(), starts.begin());
  std::vector<idx_t> all(edges.size());
  std::vector<std::size_t> next(starts.begin(), starts.end() - 1);
  for (const auto& [node, neighbour] : edges) all[next[at(node)]++] = neighbour;
  Graph graph{{0}, {}};
  std::vector<int> seen_by(at(range), -1);
  for (int node = 0; node < nodes; ++node)
  {
    for (std::size_t k = starts[at(node)]; k < starts[at(node) + 1]; ++k)
      if (std::exchange(seen_by[at(all[k])], node) != node) graph.neighbours.push_back(all[k]);
    std::sort(graph.neighbours.begin() + graph.offsets.back(), graph.neighbours.end());
    graph.offsets.push_back(static_cast<idx_t>(graph.neighbours.size()));
  }
  return graph;
}

/// Degrees of freedom that share a node: they and their neighbours are the same set, which a hash of the set decides.
struct Nodes
{
  std::vector<int> of;          // each degree of freedom
  std::vector<idx_t> sizes{};   // degrees of freedom of each node
  std::vector<char> is_first{}; // whether a degree of freedom is the first one of its node, which stands for the others

  int count() const { return static_cast<int>(sizes.size()); }
};

Nodes nodes_of(const Triplets& lower, int dofs)
{
  const auto hash = [](int dof) { return splitmix64(static_cast<std::uint64_t>(dof)); };
  std::vector<std::uint64_t> sum(at(dofs));
  for (int i = 0; i < dofs; ++i) sum[at(i)] = hash(i);
  for (std::size_t k = 0; k < lower.row.size(); ++k)
  {
    const int i = lower.row[k] - 1, j = lower.column[k] - 1;
    if (i == j || i >= dofs) continue;
    sum[at(i)] += hash(j);
    sum[at(j)] += hash(i);
  }
  std::unordered_map<std::uint64_t, int> seen;
  Nodes nodes{std::vector<int>(at(dofs))};
  for (int i = 0; i < dofs; ++i)
  {
    const auto [node, is_new] = seen.try_emplace(sum[at(i)], nodes.count());
    nodes.is_first.push_back(is_new);
    if (is_new) nodes.sizes.push_back(0);
    nodes.of[at(i)] = node->second;
    ++nodes.sizes[at(node->second)];
  }
  return nodes;
}

/// The graph with node i renamed position[i]; neighbours are ascending.
Graph renumbered(const Graph& graph, const std::vector<idx_t>& position)
{
  std::vector<int> node_at(position.size());
  for (int node = 0; node < graph.nodes(); ++node) node_at[at(position[at(node)])] = node;
  Graph result;
  result.neighbours.reserve(graph.neighbours.size());
  for (const int node : node_at)
  {
    for (const idx_t neighbour : graph.of(node)) result.neighbours.push_back(position[at(neighbour)]);
    std::sort(result.neighbours.begin() + result.offsets.back(), result.neighbours.end());
    result.offsets.push_back(static_cast<idx_t>(result.neighbours.size()));
  }
  return result;
}

/// Parents in the elimination tree (Liu 1990), -1 for a root: the first row below the pivot in each node's column.
std::vector<int> elimination_tree(const Graph& graph)
{
  std::vector<int> parent(at(graph.nodes()), -1), ancestor(at(graph.nodes()), -1);
  for (int j = 0; j < graph.nodes(); ++j)
    for (int i : graph.of(j))
      while (i < j && i >= 0)
      {
        const int next = ancestor[at(i)];
        ancestor[at(i)] = j;
        if (next < 0) parent[at(i)] = j;
        i = next;
      }
  return parent;
}

/// The position of each node in a postorder of the tree: each subtree is one run of numbers, children before parents.
std::vector<idx_t> postorder(const std::vector<int>& parent)
{
  const int nodes = static_cast<int>(parent.size());
  std::vector<std::vector<int>> children(at(nodes) + 1);
  for (int i = 0; i < nodes; ++i) children[at(parent[at(i)] < 0 ? nodes : parent[at(i)])].push_back(i);
  std::vector<idx_t> position(at(nodes));
  std::vector<std::pair<int, std::size_t>> path{{nodes, 0}}; // a node and the number of its children that are numbered
  idx_t next = 0;
  while (!path.empty())
  {
    auto& [node, done] = path.back();
    if (done < children[at(node)].size())
      path.emplace_back(children[at(node)][done++], 0);
    else
    {
      if (node < nodes) position[at(node)] = next++;
      path.pop_back();
    }
  }
  return position;
}

/// A supernode in terms of nodes; row i of the border is node `nodes` + i.
struct NodeRun
{
  int first = 0, last = 0; // nodes
  int columns = 0;         // degrees of freedom
  std::vector<int> below;  // nodes
  double zeros = 0;        // entries of its panel that elimination does not fill
};

/// Whether a supernode may hold that many zeros among its `size` entries: a larger share if it has few columns.
bool is_acceptable(double columns, double zeros, double size)
{
  return zeros <= size * (columns <= 16 ? 0.3 : columns <= 48 ? 0.1 : 0.04);
}

/// Degrees of freedom of nodes; a border row counts as one.
struct Weights
{
  const std::vector<idx_t>& of_nodes;

  int of(int node) const { return node < static_cast<int>(of_nodes.size()) ? of_nodes[at(node)] : 1; }
  int of(const std::vector<int>& nodes) const
  {
    int sum = 0;
    for (const int node : nodes) sum += of(node);
    return sum;
  }
};

std::vector<int> union_of(const std::vector<int>& a, const std::vector<int>& b)
{
  std::vector<int> both;
  both.reserve(a.size() + b.size());
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return both;
}

/// The fundamental supernodes of a graph in postorder. The rows of a column are its own and those of its children.
std::vector<NodeRun> fundamental_supernodes(const Graph& graph, const Graph& border, const std::vector<int>& parent,
                                            const Weights& weight)
{
  std::vector<std::vector<int>> from_children(at(graph.nodes()));
  std::vector<NodeRun> runs;
  for (int j = 0; j < graph.nodes(); ++j)
  {
    std::vector<int> own;
    for (const int i : graph.of(j))
      if (i > j) own.push_back(i);
    for (const int i : border.of(j)) own.push_back(graph.nodes() + i);
    std::vector<int> below = union_of(from_children[at(j)], own);
    from_children[at(j)] = {};
    if (!below.empty() && below.front() == j) below.erase(below.begin());
    if (parent[at(j)] >= 0)
    {
      std::vector<int>& above = from_children[at(parent[at(j)])];
      above = above.empty() ? below : union_of(above, below);
    }
    const bool continues = j > 0 && parent[at(j - 1)] == j && runs.back().below.size() == below.size() + 1;
    if (!continues) runs.push_back({j, j, 0, {}, 0});
    runs.back().last = j;
    runs.back().columns += weight.of(j);
    runs.back().below = std::move(below);
  }
  return runs;
}

/// Joins supernodes with their last children where that brings few zeros.
std::vector<NodeRun> amalgamate(std::vector<NodeRun> runs, const std::vector<int>& parent, const Weights& weight)
{
  std::vector<NodeRun> kept;
  for (NodeRun& run : runs)
  {
    while (!kept.empty() && parent[at(kept.back().last)] >= run.first && parent[at(kept.back().last)] <= run.last)
    {
      const NodeRun& child = kept.back();
      const double below = weight.of(run.below), columns = child.columns + run.columns;
      const double zeros = child.zeros + run.zeros + child.columns * (run.columns + below - weight.of(child.below));
      if (!is_acceptable(columns, zeros, columns * (columns + below))) break;
      run.first = child.first;
      run.columns += child.columns;
      run.zeros = zeros;
      kept.pop_back();
    }
    kept.push_back(std::move(run));
  }
  return kept;
}

/// Sets the supernodes of `result` in degrees of freedom; `starts`: the first position of each node.
void expand(const std::vector<NodeRun>& runs, const std::vector<int>& starts, SymbolicFactor& result)
{
  const int nodes = static_cast<int>(starts.size()) - 1;
  std::vector<int> run_of(at(nodes));
  for (std::size_t k = 0; k < runs.size(); ++k)
    for (int node = runs[k].first; node <= runs[k].last; ++node) run_of[at(node)] = static_cast<int>(k);
  result.supernodes.resize(runs.size());
  for (std::size_t k = 0; k < runs.size(); ++k)
  {
    Supernode& supernode = result.supernodes[k];
    supernode.first = starts[at(runs[k].first)];
    supernode.columns = runs[k].columns;
    supernode.rows_begin = result.rows.size();
    supernode.values_begin = result.values;
    for (const int node : runs[k].below)
      if (node >= nodes)
      {
        result.rows.push_back(result.dofs + node - nodes);
        ++supernode.border;
      }
      else
        for (int row = starts[at(node)]; row < starts[at(node) + 1]; ++row) result.rows.push_back(row);
    supernode.below = static_cast<int>(result.rows.size() - supernode.rows_begin);
    result.values += packed_triangle(at(supernode.columns)) + packed_panel(at(supernode.below), at(supernode.columns));
    result.entries += supernode.columns * (0.5 * (supernode.columns + 1) + supernode.below);
    if (supernode.inner() > 0)
      result.supernodes[at(run_of[at(runs[k].below.front())])].children.push_back(static_cast<int>(k));
  }
}

/// Adjacency of the nodes among each other, and to the rows of the border, as (node, neighbour) pairs.
struct Edges
{
  std::vector<std::pair<int, int>> inner, border;
};

Edges edges_of(const Triplets& lower, int dofs, const Nodes& nodes)
{
  Edges edges;
  for (std::size_t k = 0; k < lower.row.size(); ++k)
  {
    const int i = lower.row[k] - 1, j = lower.column[k] - 1;
    if (i >= dofs)
      edges.border.emplace_back(nodes.of[at(j)], i - dofs);
    else if (i != j && nodes.is_first[at(i)] && nodes.is_first[at(j)])
    {
      edges.inner.emplace_back(nodes.of[at(i)], nodes.of[at(j)]);
      edges.inner.emplace_back(nodes.of[at(j)], nodes.of[at(i)]);
    }
  }
  return edges;
}

SymbolicFactor analysis_of(const Triplets& lower, int dofs, int border)
{
  SymbolicFactor result;
  result.dofs = dofs;
  result.border = border;
  const Nodes nodes = nodes_of(lower, dofs);
  Edges edges = edges_of(lower, dofs, nodes);
  Graph graph = graph_of(nodes.count(), nodes.count(), edges.inner);
  std::vector<idx_t> position = nested_dissection(graph, nodes.sizes);
  std::vector<idx_t> ordered_sizes(position.size());
  const std::vector<idx_t> moved = postorder(elimination_tree(renumbered(graph, position)));
  for (idx_t& place : position) place = moved[at(place)];
  graph = renumbered(graph, position);
  for (std::size_t i = 0; i < position.size(); ++i) ordered_sizes[at(position[i])] = nodes.sizes[i];
  for (auto& [node, row] : edges.border) node = position[at(node)];

  const std::vector<int> parent = elimination_tree(graph);
  const Weights weight{ordered_sizes};
  const Graph to_border = graph_of(nodes.count(), border, edges.border);
  std::vector<int> starts(position.size() + 1, 0);
  std::partial_sum(ordered_sizes.begin(), ordered_sizes.end(), starts.begin() + 1);
  expand(amalgamate(fundamental_supernodes(graph, to_border, parent, weight), parent, weight), starts, result);
  std::vector<int> next = starts;
  for (const int node : nodes.of) result.position.push_back(next[at(position[at(node)])]++);
  return result;
}

/// A hash of the entries' places and of the sizes.
std::uint64_t hash_of(const Triplets& lower, int dofs, int border)
{
  const auto both = [](int a, int b)
  { return static_cast<std::uint64_t>(a) << 32 | static_cast<std::uint64_t>(static_cast<unsigned>(b)); };
  std::uint64_t hash = splitmix64(both(dofs, border));
  for (std::size_t k = 0; k < lower.row.size(); ++k) hash = splitmix64(hash ^ both(lower.row[k], lower.column[k]));
  return hash;
}

} // namespace

SymbolicFactor analyse(const Triplets& lower, int dofs, int border, MPI_Comm comm, KnownAnalyses* known)
{
  constexpr std::size_t most = 6; // a model with a motion has five: K and A with and without border, one reduced
  KnownAnalyses none;
  auto& last = known ? known->last : none.last;
  on_rank_zero(comm,
               [&]
               {
                 const std::uint64_t pattern = hash_of(lower, dofs, border);
                 const auto found = std::ranges::find(last, pattern, &decltype(none.last)::value_type::first);
                 if (found == last.end())
                   last.emplace_front(pattern, analysis_of(lower, dofs, border));
                 else
                   std::rotate(last.begin(), found, found + 1);
                 if (last.size() > most) last.pop_back();
               });
  return rank_of(comm) == 0 ? last.front().second : SymbolicFactor();
}

} // namespace squeal
