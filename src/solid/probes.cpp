/// Probe matrices: a row for each probe, which reads one displacement.
#include "squeal/solid/probes.hpp"

#include "squeal/mesh/names.hpp"
#include "squeal/solid/sparse_rows.hpp"

#include <algorithm>
#include <charconv>

namespace squeal
{

namespace
{

/// Returns the diagonal of the box around the nodes [m].
double diagonal(const std::vector<Vec3>& nodes)
{
  Vec3 low = nodes.front(), high = nodes.front();
  for (const Vec3& node : nodes)
    for (int c = 0; c < 3; ++c)
    {
      low[c] = std::min(low[c], node[c]);
      high[c] = std::max(high[c], node[c]);
    }
  return norm(high - low);
}

/// Returns the node of a probe: of its point or group, the one nearest to its position.
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
  if (const double size = diagonal(mesh.nodes); size > 0 && distance(nearest) > 100 * size)
    throw Error(user + format(": 'at' lies %g m from the nearest node of the group, where the whole mesh measures %g m",
                              distance(nearest), size));
  return nearest;
}

/// Returns N of a probe on "dof:N".
PetscInt probed_dof(const Probe& probe, PetscInt dofs)
{
  PetscInt dof = -1;
  const std::string prefix = "dof:";
  const char* const end = probe.on.data() + probe.on.size();
  const bool prefixed = probe.on.compare(0, prefix.size(), prefix) == 0;
  const auto [stop, error] = std::from_chars(probe.on.data() + (prefixed ? prefix.size() : 0), end, dof);
  if (!prefixed || error != std::errc() || stop != end || dof < 0 || dof >= dofs)
    throw Error("probe " + probe.name + ": on = \"" + probe.on +
                "\"; on a matrix scene it is \"dof:N\" with N from 0 to " + std::to_string(dofs - 1));
  return dof;
}

/// Returns the matrix of the rows that row_of gives. All probes are visited on every rank, so that errors are thrown by
/// all of them.
template <class RowOf>
Owned<Mat> matrix_of_probes(const std::vector<Probe>& probes, RowOf row_of, PetscInt local_columns, MPI_Comm comm)
{
  std::vector<SparseRow> rows;
  const auto [first, last] = local_range(static_cast<PetscInt>(probes.size()), comm);
  for (PetscInt i = 0; i < static_cast<PetscInt>(probes.size()); ++i)
  {
    SparseRow row = row_of(probes[i]);
    if (i >= first && i < last) rows.push_back(std::move(row));
  }
  return matrix_of_rows(rows, local_columns, comm);
}

} // namespace

Owned<Mat> probe_rows(const std::vector<Probe>& probes, const Mesh& mesh, const DofMap& dofs, MPI_Comm comm)
{
  const auto row_of = [&](const Probe& probe)
  {
    SparseRow row;
    add_displacement(dofs, probed_node(probe, mesh), probe.direction, row);
    if (std::all_of(row.begin(), row.end(), [](const auto& entry) { return entry.second == 0; }))
      throw Error("probe " + probe.name + ": the motion of " + probe.on +
                  " in its direction is held, so it would read 0");
    return row;
  };
  return matrix_of_probes(probes, row_of, dofs.last - dofs.first, comm);
}

Owned<Mat> probe_rows(const std::vector<Probe>& probes, const Structure& structure, MPI_Comm comm)
{
  PetscInt dofs = 0, local_dofs = 0;
  check(MatGetSize(structure.M, &dofs, nullptr));
  check(MatGetLocalSize(structure.M, &local_dofs, nullptr));
  const auto row_of = [&](const Probe& probe) { return SparseRow{{probed_dof(probe, dofs), 1.}}; };
  return matrix_of_probes(probes, row_of, local_dofs, comm);
}

} // namespace squeal
