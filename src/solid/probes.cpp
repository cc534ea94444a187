/// Probe matrices: a row for each probe, which reads one displacement.
#include "squeal/solid/probes.hpp"

#include "squeal/solid/sparse_rows.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

int probed_node(const Probe& probe, const Mesh& mesh)
{
  const std::string user = "probe " + probe.name;
  const auto nodes = named_nodes(mesh, probe.on, user);
  if (nodes.empty()) throw Error(user + ": group \"" + probe.on + "\" has no nodes");
  if (nodes.size() > 1 && !probe.at)
    throw Error(user + ": group \"" + probe.on + "\" has " + std::to_string(nodes.size()) +
                " nodes; 'at' says which one is meant");
  const auto distance = [&](int node) { return probe.at ? norm(mesh.nodes[node] - *probe.at) : 0; };
  const int nearest =
      *std::min_element(nodes.begin(), nodes.end(), [&](int a, int b) { return distance(a) < distance(b); });
  // A position outside may be meant, to name an end; one beyond 100 lengths of the mesh is a slip, of units say.
  if (const double size = diagonal_of(mesh.nodes); size > 0 && distance(nearest) > 100 * size)
    throw Error(user + format(": 'at' is %g m from the nearest node of the group, where the whole mesh measures %g m",
                              distance(nearest), size));
  return nearest;
}

} // namespace

std::vector<int> probed_nodes(const std::vector<Probe>& probes, const Mesh& mesh)
{
  std::vector<int> nodes;
  for (const Probe& probe : probes) nodes.push_back(probed_node(probe, mesh));
  return nodes;
}

Owned<Mat> probe_rows(const std::vector<Probe>& probes, const Mesh& mesh, const DofMap& dofs, MPI_Comm comm)
{
  std::vector<SparseRow> rows; // all of them, on rank 0
  const auto add_all = [&]
  {
    for (const Probe& probe : probes)
    {
      SparseRow& row = rows.emplace_back();
      add_displacement(dofs, probed_node(probe, mesh), probe.direction, row);
      if (std::all_of(row.begin(), row.end(), [](const auto& entry) { return entry.second == 0; }))
        throw Error("probe " + probe.name + ": the motion of " + probe.on +
                    " in its direction is held, so it would read 0");
    }
  };
  on_rank_zero(comm, add_all);
  return matrix_of_rows(scattered_rows(std::move(rows), static_cast<PetscInt>(probes.size()), comm),
                        dofs.last - dofs.first, comm);
}

} // namespace squeal
