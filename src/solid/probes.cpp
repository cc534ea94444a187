#include "squeal/mesh/names.hpp"
#include "squeal/mesh/vector.hpp"
#include "squeal/solid/rows.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace squeal
{

namespace
{

int probed_node(const Probe& probe, const Mesh& mesh)
{
  const std::string asker = "probe " + probe.name;
  const auto nodes = named_nodes(mesh, probe.on, asker);
  if (nodes.empty()) throw Error(asker + ": group \"" + probe.on + "\" has no nodes");
  if (nodes.size() > 1 && !probe.at)
    throw Error(asker + ": group \"" + probe.on + "\" has " + std::to_string(nodes.size()) +
                " nodes; 'at' says which one is meant");
  const auto distance = [&](int node)
  { return probe.at ? norm(mesh.nodes[static_cast<std::size_t>(node)] - *probe.at) : 0; };
  return *std::min_element(nodes.begin(), nodes.end(), [&](int a, int b) { return distance(a) < distance(b); });
}

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

} // namespace

void add_motion(const DofMap& dofs, int node, const Vec3& direction, Row& row)
{
  for (int c = 0; c < 3; ++c)
    for (const DofTerm& term : dofs.of(node, c)) row[term.dof] += direction[static_cast<std::size_t>(c)] * term.factor;
}

std::pair<PetscInt, PetscInt> share_of(PetscInt count, MPI_Comm comm)
{
  const PetscInt ranks = ranks_of(comm), rank = rank_of(comm);
  const PetscInt size = count / ranks, rest = count % ranks;
  const PetscInt first = rank * size + std::min(rank, rest);
  return {first, first + size + (rank < rest ? 1 : 0)};
}

Owned<Mat> matrix_of_rows(const std::vector<Row>& rows, PetscInt local_columns, MPI_Comm comm)
{
  std::vector<PetscInt> offsets{0}, columns;
  std::vector<double> values;
  for (const Row& row : rows)
  {
    for (const auto& [column, value] : row)
    {
      if (std::abs(value) < 1e-14) continue; // direction cosines and lever arms [m]: what is left of a cancellation
      columns.push_back(column);
      values.push_back(value);
    }
    offsets.push_back(static_cast<PetscInt>(columns.size()));
  }
  Owned<Mat> A;
  check(MatCreate(comm, A.put()));
  check(MatSetSizes(A, static_cast<PetscInt>(rows.size()), local_columns, PETSC_DETERMINE, PETSC_DETERMINE));
  check(MatSetType(A, MATAIJ));
  // Each applies to its own kind of AIJ and is silent on the other.
  check(MatSeqAIJSetPreallocationCSR(A, offsets.data(), columns.data(), values.data()));
  check(MatMPIAIJSetPreallocationCSR(A, offsets.data(), columns.data(), values.data()));
  return A;
}

Owned<Mat> probe_rows(const std::vector<Probe>& probes, const Mesh& mesh, const DofMap& dofs, MPI_Comm comm)
{
  std::vector<Row> rows;
  const auto [first, last] = share_of(static_cast<PetscInt>(probes.size()), comm);
  for (PetscInt i = 0; i < static_cast<PetscInt>(probes.size()); ++i)
  {
    const Probe& probe = probes[static_cast<std::size_t>(i)];
    const int node = probed_node(probe, mesh);
    if (i < first || i >= last) continue;
    rows.emplace_back();
    add_motion(dofs, node, probe.direction, rows.back());
  }
  return matrix_of_rows(rows, dofs.last - dofs.first, comm);
}

Owned<Mat> probe_rows(const std::vector<Probe>& probes, const Structure& structure, MPI_Comm comm)
{
  PetscInt dofs = 0, local_dofs = 0;
  check(MatGetSize(structure.M, &dofs, nullptr));
  check(MatGetLocalSize(structure.M, &local_dofs, nullptr));
  std::vector<Row> rows;
  const auto [first, last] = share_of(static_cast<PetscInt>(probes.size()), comm);
  for (PetscInt i = 0; i < static_cast<PetscInt>(probes.size()); ++i)
  {
    const PetscInt dof = probed_dof(probes[static_cast<std::size_t>(i)], dofs);
    if (i >= first && i < last) rows.push_back({{dof, 1.}});
  }
  return matrix_of_rows(rows, local_dofs, comm);
}

} // namespace squeal
