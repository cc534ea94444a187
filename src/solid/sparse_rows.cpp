#include "squeal/solid/structure.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

SparseRow displacement_row(const DofMap& dofs, std::span<const PairNode> nodes, const Vec3& direction)
{
  SparseRow row;
  for (const auto& [node, weight] : nodes)
    for (int c = 0; c < 3; ++c)
      for (const DofTerm& term : dofs.terms_of(6 * PetscInt{node} + c))
        row[term.dof] += weight * direction[c] * term.factor;
  // direction cosines and lever arms [m] that cancelled up to round-off
  std::erase_if(row, [](const auto& entry) { return std::abs(entry.second) < 1e-14; });
  return row;
}

Owned<Mat> matrix_of_rows(const std::vector<SparseRow>& rows, PetscInt local_columns, MPI_Comm comm)
{
  std::vector<PetscInt> offsets{0}, columns;
  std::vector<double> values;
  for (const SparseRow& row : rows)
  {
    for (const auto& [column, value] : row)
    {
      columns.push_back(column);
      values.push_back(value);
    }
    offsets.push_back(static_cast<PetscInt>(columns.size()));
  }
  Owned<Mat> A;
  check(MatCreate(comm, A.put()));
  check(MatSetSizes(A, static_cast<PetscInt>(rows.size()), local_columns, PETSC_DETERMINE, PETSC_DETERMINE));
  check(MatSetType(A, MATAIJ));
  // Each of the two calls acts on its own type of AIJ and does nothing on the other.
  check(MatSeqAIJSetPreallocationCSR(A, offsets.data(), columns.data(), values.data()));
  check(MatMPIAIJSetPreallocationCSR(A, offsets.data(), columns.data(), values.data()));
  return A;
}

Owned<IS> set_of(MPI_Comm comm, const std::vector<PetscInt>& places)
{
  Owned<IS> set;
  check(ISCreateGeneral(comm, static_cast<PetscInt>(places.size()), places.data(), PETSC_COPY_VALUES, set.put()));
  return set;
}

Owned<IS> set_of(MPI_Comm comm, const IndexRange& range)
{
  Owned<IS> set;
  check(ISCreateStride(comm, range.size(), range.first, 1, set.put()));
  return set;
}

Owned<Mat> part_of(Mat A, IS rows, IS columns)
{
  Owned<Mat> result;
  check(MatCreateSubMatrix(A, rows, columns, MAT_INITIAL_MATRIX, result.put()));
  return result;
}

void finish(Mat A)
{
  check(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
}

void finish(Vec x)
{
  check(VecAssemblyBegin(x));
  check(VecAssemblyEnd(x));
}

std::pair<PetscInt, PetscInt> local_range(PetscInt count, MPI_Comm comm)
{
  const PetscInt rank = rank_of(comm), ranks = ranks_of(comm), size = count / ranks, rest = count % ranks;
  const PetscInt first = rank * size + std::min(rank, rest);
  return {first, first + size + (rank < rest ? 1 : 0)};
}

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
  std::vector<SparseRow> rows;
  const auto add_all = [&]
  {
    for (const Probe& probe : probes)
    {
      const PairNode at{probed_node(probe, mesh), 1};
      rows.push_back(displacement_row(dofs, std::span(&at, 1), probe.direction));
      if (rows.back().empty())
        throw Error("probe " + probe.name + ": the motion of " + probe.on +
                    " in its direction is held, so it would read 0");
    }
  };
  on_every_rank(comm, add_all);
  const auto [first, last] = local_range(static_cast<PetscInt>(probes.size()), comm);
  return matrix_of_rows({rows.begin() + first, rows.begin() + last}, dofs.last - dofs.first, comm);
}

} // namespace squeal
