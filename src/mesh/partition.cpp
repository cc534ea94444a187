/// Partition of the mesh by METIS (Karypis and Kumar 1998).
///
/// Two nodes are neighbours when an element has both. The slave node of a contact pair and the master node of largest
/// weight are merged into one vertex, so that both have the same owner. The weight of a vertex is the number of its
/// nodal degrees of freedom.
#include "squeal/mesh/contact_pairs.hpp"

#include "squeal/base/disjoint_sets.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <metis.h>

namespace squeal
{

namespace
{

struct Vertices
{
  std::vector<int> of_node;
  idx_t count = 0;
};

/// Merges the two heaviest nodes of each pair, and of pairs that share one, into one vertex.
Vertices merge_pairs(std::size_t nodes, const std::vector<ContactPair>& pairs)
{
  DisjointSets sets(nodes);
  for (const ContactPair& pair : pairs) sets.join(pair.rotor_node, pair.stator_node);
  Vertices vertices{std::vector<int>(nodes), 0};
  for (int i = 0; i < sets.size(); ++i)
    vertices.of_node[i] = sets.least(i) == i ? vertices.count++ : vertices.of_node[sets.least(i)];
  return vertices;
}

/// Returns the owner of each vertex. Each rank owns at least one vertex, where there are as many.
std::vector<idx_t> owners_of(const Mesh& mesh, Vertices vertices, idx_t ranks)
{
  std::vector<idx_t> offsets{0}, nodes, weights(vertices.count, 0), element_owner(mesh.elements.size()),
      owner(vertices.count), options(METIS_NOPTIONS);
  std::vector<int> dofs(mesh.nodes.size(), 3);
  for (const Element& element : mesh.elements)
  {
    for (const int node : nodes_of(element))
    {
      if (is_shell(element.shape)) dofs[node] = 6;
      nodes.push_back(vertices.of_node[node]);
    }
    offsets.push_back(static_cast<idx_t>(nodes.size()));
  }
  for (std::size_t i = 0; i < dofs.size(); ++i) weights[vertices.of_node[i]] += dofs[i];
  METIS_SetDefaultOptions(options.data());
  options[METIS_OPTION_SEED] = 1; // the same partition on every run
  auto elements = static_cast<idx_t>(mesh.elements.size());
  idx_t cut = 0;
  const Finally waiting = without_sigterm();
  if (elements > 0 && vertices.count >= ranks &&
      METIS_PartMeshNodal(&elements, &vertices.count, offsets.data(), nodes.data(), weights.data(), nullptr, &ranks,
                          nullptr, options.data(), &cut, element_owner.data(), owner.data()) != METIS_OK)
    throw Error("METIS could not partition the mesh into " + std::to_string(ranks) + " parts");
  for (idx_t rank = 0; rank < ranks; ++rank)
    if (std::ranges::find(owner, rank) == owner.end()) // METIS may leave a rank empty on a small mesh
    {
      for (idx_t v = 0; v < vertices.count; ++v) owner[v] = v * ranks / std::max(vertices.count, ranks);
      break;
    }
  return owner;
}

} // namespace

Partition partition_mesh(const Mesh& mesh, const std::vector<ContactPair>& pairs, int ranks)
{
  Partition partition{std::vector<int>(mesh.nodes.size()), std::vector<int>(mesh.elements.size())};
  if (ranks == 1) return partition;
  const std::size_t nodes = mesh.nodes.size();
  if (nodes < static_cast<std::size_t>(ranks))
    throw Error(std::to_string(ranks) + " ranks are too many for a model of " + std::to_string(nodes) +
                " nodes: use at most " + std::to_string(nodes));
  const Vertices vertices = merge_pairs(nodes, pairs);
  const std::vector<idx_t> owner = owners_of(mesh, vertices, ranks);
  for (std::size_t i = 0; i < nodes; ++i) partition.node_rank[i] = static_cast<int>(owner[vertices.of_node[i]]);
  for (std::size_t e = 0; e < mesh.elements.size(); ++e)
    partition.element_rank[e] = partition.node_rank[mesh.elements[e].nodes.front()];
  return partition;
}

} // namespace squeal
