#include "elimination.hpp"

#include "squeal/algebra/panel.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <cstdint>
#include <metis.h>
#include <numeric>
#include <span>
#include <unordered_map>
#include <utility>

namespace squeal
{

namespace
{

std::size_t at(int number)
{
  return static_cast<std::size_t>(number);
}

/// Neighbours of every node, one list after the other.
struct Graph
{
  std::vector<idx_t> offsets, neighbours;

  int nodes() const { return static_cast<int>(offsets.size()) - 1; }
  std::span<const idx_t> of(int node) const
  {
    return {neighbours.data() + offsets[at(node)], neighbours.data() + offsets[at(node) + 1]};
  }
};

/// Of (node, neighbour) pairs, each neighbour once; neighbours are below `range`.
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
  graph.neighbours.reserve(1); // never without an address
  return graph;
}

/// A number for every degree of freedom, the same where they and their neighbours are the same set.
std::vector<int> group(const Triplets& lower, int dofs, int& groups)
{
  const auto mixed = [](int number)
  {
    std::uint64_t x = static_cast<std::uint64_t>(number) + 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
  };
  std::vector<std::uint64_t> sum(at(dofs));
  for (int i = 0; i < dofs; ++i) sum[at(i)] = mixed(i);
  for (std::size_t k = 0; k < lower.row.size(); ++k)
  {
    const int i = lower.row[k] - 1, j = lower.column[k] - 1;
    if (i == j || i >= dofs) continue;
    sum[at(i)] += mixed(j);
    sum[at(j)] += mixed(i);
  }
  std::unordered_map<std::uint64_t, int> seen;
  std::vector<int> number(at(dofs));
  for (int i = 0; i < dofs; ++i)
    number[at(i)] = seen.try_emplace(sum[at(i)], static_cast<int>(seen.size())).first->second;
  groups = static_cast<int>(seen.size());
  return number;
}

/// Position of each node by nested dissection.
std::vector<idx_t> dissect(Graph& graph, std::vector<idx_t>& weights)
{
  std::vector<idx_t> order(weights.size()), position(weights.size()), options(METIS_NOPTIONS);
  METIS_SetDefaultOptions(options.data());
  options[METIS_OPTION_COMPRESS] = 0; // done
  idx_t size = graph.nodes();
  if (METIS_NodeND(&size, graph.offsets.data(), graph.neighbours.data(), weights.data(), options.data(), order.data(),
                   position.data()) != METIS_OK)
    throw LibraryError("METIS found no elimination order");
  return position;
}

/// The graph with its nodes renumbered.
Graph renumbered(const Graph& graph, const std::vector<idx_t>& position)
{
  std::vector<std::pair<int, int>> edges;
  edges.reserve(graph.neighbours.size());
  for (int node = 0; node < graph.nodes(); ++node)
    for (const idx_t neighbour : graph.of(node)) edges.emplace_back(position[at(node)], position[at(neighbour)]);
  return graph_of(graph.nodes(), graph.nodes(), edges);
}

/// Elimination tree (Liu 1990): the node whose column takes each node's update; -1 for none.
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

/// Position of each node when every subtree is numbered in one run, children before parents.
std::vector<idx_t> postorder(const std::vector<int>& parent)
{
  const int nodes = static_cast<int>(parent.size());
  std::vector<std::vector<int>> children(at(nodes) + 1);
  for (int i = 0; i < nodes; ++i) children[at(parent[at(i)] < 0 ? nodes : parent[at(i)])].push_back(i);
  std::vector<idx_t> position(at(nodes));
  std::vector<std::pair<int, std::size_t>> path{{nodes, 0}}; // a node, and how many of its children are done
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

/// A run of nodes with one set of rows below, as nodes; border row i is node `nodes` + i.
struct Run
{
  int first = 0, last = 0, columns = 0;
  std::vector<int> below;
  double zeros = 0; // entries of its panel that elimination does not fill
};

/// Whether longer columns are worth the zeros they read: much of a small panel, little of a large one.
bool worthwhile(double columns, double zeros, double size)
{
  return zeros <= size * (columns <= 16 ? .3 : columns <= 48 ? .1 : .04);
}

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

std::vector<int> united(const std::vector<int>& a, const std::vector<int>& b)
{
  std::vector<int> both;
  both.reserve(a.size() + b.size());
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return both;
}

/// Runs of a graph in postorder whose columns have one structure; that of a column is its own and its children's.
std::vector<Run> find_runs(const Graph& graph, const Graph& border, const std::vector<int>& parent,
                           const Weights& weight)
{
  std::vector<std::vector<int>> from_children(at(graph.nodes()));
  std::vector<Run> runs;
  for (int j = 0; j < graph.nodes(); ++j)
  {
    std::vector<int> own;
    for (const int i : graph.of(j))
      if (i > j) own.push_back(i);
    for (const int i : border.of(j)) own.push_back(graph.nodes() + i);
    std::vector<int> below = united(from_children[at(j)], own);
    from_children[at(j)] = {};
    if (!below.empty() && below.front() == j) below.erase(below.begin());
    if (parent[at(j)] >= 0)
    {
      std::vector<int>& above = from_children[at(parent[at(j)])];
      above = above.empty() ? below : united(above, below);
    }
    const bool continues = j > 0 && parent[at(j - 1)] == j && runs.back().below.size() == below.size() + 1;
    if (!continues) runs.push_back({j, j, 0, {}, 0});
    runs.back().last = j;
    runs.back().columns += weight.of(j);
    runs.back().below = std::move(below);
  }
  return runs;
}

/// Runs joined with their last children, where that is worthwhile.
std::vector<Run> joined(std::vector<Run> runs, const std::vector<int>& parent, const Weights& weight)
{
  std::vector<Run> kept;
  for (Run& run : runs)
  {
    while (!kept.empty() && parent[at(kept.back().last)] >= run.first && parent[at(kept.back().last)] <= run.last)
    {
      const Run& child = kept.back();
      const double below = weight.of(run.below), columns = child.columns + run.columns;
      const double zeros = child.zeros + run.zeros + child.columns * (run.columns + below - weight.of(child.below));
      if (!worthwhile(columns, zeros, columns * (columns + below))) break;
      run.first = child.first;
      run.columns += child.columns;
      run.zeros = zeros;
      kept.pop_back();
    }
    kept.push_back(std::move(run));
  }
  return kept;
}

/// The supernodes in degrees of freedom; `starts`: the first position of each node.
void expand(const std::vector<Run>& runs, const std::vector<int>& starts, Elimination& result)
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
    supernode.rows = result.rows.size();
    supernode.values = result.values;
    for (const int node : runs[k].below)
      if (node >= nodes)
      {
        result.rows.push_back(result.dofs + node - nodes);
        ++supernode.bordering;
      }
      else
        for (int row = starts[at(node)]; row < starts[at(node) + 1]; ++row) result.rows.push_back(row);
    supernode.below = static_cast<int>(result.rows.size() - supernode.rows);
    result.values += packed_triangle(at(supernode.columns)) + packed_panel(at(supernode.below), at(supernode.columns));
    result.entries += .5 * supernode.columns * (supernode.columns + 1) + 1. * supernode.below * supernode.columns;
    if (supernode.inner() > 0)
      result.supernodes[at(run_of[at(runs[k].below.front())])].children.push_back(static_cast<int>(k));
  }
}

} // namespace

Elimination eliminate(const Triplets& lower, int dofs, int border)
{
  Elimination result;
  result.dofs = dofs;
  result.border = border;
  int nodes = 0;
  const std::vector<int> node_of = group(lower, dofs, nodes);
  std::vector<idx_t> weights(at(nodes), 0);
  for (const int node : node_of) ++weights[at(node)];
  std::vector<std::pair<int, int>> edges, rows;
  for (std::size_t k = 0; k < lower.row.size(); ++k)
  {
    const int i = lower.row[k] - 1, j = node_of[at(lower.column[k] - 1)];
    if (i >= dofs)
      rows.emplace_back(j, i - dofs);
    else if (node_of[at(i)] != j)
    {
      edges.emplace_back(node_of[at(i)], j);
      edges.emplace_back(j, node_of[at(i)]);
    }
  }
  Graph graph = graph_of(nodes, nodes, edges);
  edges = {};
  std::vector<idx_t> position = dissect(graph, weights);
  const std::vector<idx_t> moved = postorder(elimination_tree(renumbered(graph, position)));
  for (idx_t& place : position) place = moved[at(place)];
  graph = renumbered(graph, position);
  std::vector<idx_t> moved_weights(weights.size());
  for (std::size_t i = 0; i < weights.size(); ++i) moved_weights[at(position[i])] = weights[i];
  for (auto& [node, row] : rows) node = position[at(node)];
  const std::vector<int> parent = elimination_tree(graph);
  const Weights weight{moved_weights};
  const std::vector<Run> runs = joined(find_runs(graph, graph_of(nodes, border, rows), parent, weight), parent, weight);
  std::vector<int> starts(at(nodes) + 1, 0), next;
  std::partial_sum(moved_weights.begin(), moved_weights.end(), starts.begin() + 1);
  expand(runs, starts, result);
  next = starts;
  for (const int node : node_of) result.position.push_back(next[at(position[at(node)])]++);
  return result;
}

} // namespace squeal
