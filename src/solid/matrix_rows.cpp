/// Supports of a matrix scene are exact: their rows and columns are taken out of the matrices.
#include "squeal/solid/matrix_rows.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/solid/sparse_rows.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

std::vector<NodeMotion> motions_in(const std::filesystem::path& file, PetscInt size)
{
  auto motions = read_row_motions(file);
  if (static_cast<PetscInt>(motions.size()) != size)
    throw Error(file.string() + ": " + std::to_string(motions.size()) + " lines, but M.petsc has " +
                std::to_string(size) + " rows: one line for each row is needed");
  return motions;
}

/// The rows that a text names, in the order of the files.
std::vector<PetscInt> rows_of(const MatrixRows& rows, const std::string& on, const std::string& user)
{
  const auto names = row_names(on);
  if (!names) throw Error(user + ": on = \"" + on + "\": expected \"dof:N\" or \"node:N\"");
  if (names->nodes && rows.motions.empty())
    throw Error(user + ": on = \"" + on + "\": the folder of the matrices has no dofs.txt, which says what node each " +
                "row belongs to; tools/matrices writes one, or name rows by \"dof:N\"");
  std::vector<PetscInt> found;
  for (const RowNames::Range& range : names->ranges)
  {
    const std::size_t before = found.size();
    for (PetscInt row = 0; row < rows.size; ++row)
      if (const long key = names->nodes ? rows.motions[row].node : row; key >= range.first && key <= range.last)
        found.push_back(row);
    if (found.size() == before || (!names->nodes && range.last >= rows.size))
      throw Error(user + ": on = \"" + on + "\": " +
                  (names->nodes ? "no row of the matrices belongs to node " + std::to_string(range.first)
                                : "the matrices have the rows 0 to " + std::to_string(rows.size - 1)));
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

bool names_nodes(const std::string& on)
{
  const std::optional<RowNames> names = row_names(on);
  return names && names->nodes;
}

} // namespace

MatrixRows read_matrix_rows(const std::filesystem::path& folder, PetscInt size, MPI_Comm comm)
{
  MatrixRows rows;
  rows.size = size;
  const auto file = folder / "dofs.txt";
  on_rank_zero(comm,
               [&]
               {
                 if (is_file(file)) rows.motions = motions_in(file, size);
               });
  broadcast(rows.motions, comm);
  return rows;
}

void add_forces(const MatrixRows& rows, const std::vector<Force>& forces, Vec load)
{
  const int rank = rank_of(comm_of(load));
  for (const Force& force : forces)
  {
    const auto found = rows_of(rows, force.on, "force on " + force.on);
    for (std::size_t c = 0; c < 3; ++c)
    {
      if (force.vector[c] == 0) continue;
      std::vector<PetscInt> pushed;
      for (const PetscInt row : found)
        if (!names_nodes(force.on) || rows.motions[row].motion == static_cast<int>(c)) pushed.push_back(row);
      if (pushed.empty())
        throw Error("force on " + force.on + ": the matrices have no row for its motion " + motion_words[c]);
      if (rank != 0) continue;
      for (const PetscInt row : pushed)
        check(VecSetValue(load, row, force.vector[c] / static_cast<double>(pushed.size()), ADD_VALUES));
    }
  }
  check(VecAssemblyBegin(load));
  check(VecAssemblyEnd(load));
}

std::vector<PetscInt> held_rows(const MatrixRows& rows, const std::vector<Support>& supports)
{
  std::vector<PetscInt> held;
  for (const Support& support : supports)
  {
    const std::size_t before = held.size();
    for (const PetscInt row : rows_of(rows, support.on, "support on " + support.on))
    {
      const int motion = names_nodes(support.on) ? rows.motions[row].motion : 0;
      if (motion >= 0 && support.fixed[static_cast<std::size_t>(motion)]) held.push_back(row);
    }
    if (held.size() == before)
      throw Error("support on " + support.on + ": the matrices have no row for the motions that it holds");
  }
  std::sort(held.begin(), held.end());
  held.erase(std::unique(held.begin(), held.end()), held.end());
  if (static_cast<PetscInt>(held.size()) == rows.size) throw Error("the supports hold every row of the matrices");
  return held;
}

Owned<Mat> probe_rows(const std::vector<Probe>& probes, const MatrixRows& rows, PetscInt local_columns, MPI_Comm comm)
{
  std::vector<SparseRow> own;
  const auto [first, last] = local_range(static_cast<PetscInt>(probes.size()), comm);
  for (PetscInt i = 0; i < static_cast<PetscInt>(probes.size()); ++i)
  {
    const Probe& probe = probes[static_cast<std::size_t>(i)];
    SparseRow read;
    for (const PetscInt row : rows_of(rows, probe.on, "probe " + probe.name))
    {
      const int motion = names_nodes(probe.on) ? rows.motions[row].motion : -1;
      const double factor = !names_nodes(probe.on) ? 1 : motion >= 0 && motion < 3 ? probe.direction[motion] : 0;
      if (factor != 0) read[row] = factor;
    }
    if (read.empty())
      throw Error("probe " + probe.name + ": the matrices have no row for its direction at " + probe.on);
    if (i >= first && i < last) own.push_back(std::move(read));
  }
  return matrix_of_rows(own, local_columns, comm);
}

Elimination::Elimination(const std::vector<PetscInt>& held, Vec layout)
{
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(layout, &first, &last));
  std::vector<PetscInt> kept;
  for (PetscInt row = first; row < last; ++row)
    if (!std::binary_search(held.begin(), held.end(), row)) kept.push_back(row);
  check(ISCreateGeneral(comm_of(layout), static_cast<PetscInt>(kept.size()), kept.data(), PETSC_COPY_VALUES,
                        kept_.put()));
}

Owned<Mat> Elimination::square(Mat A) const
{
  if (!A) return {};
  Owned<Mat> result;
  check(MatCreateSubMatrix(A, kept_, kept_, MAT_INITIAL_MATRIX, result.put()));
  return result;
}

Owned<Mat> Elimination::columns(Mat A) const
{
  if (!A) return {};
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(A, &first, &last));
  Owned<IS> rows;
  check(ISCreateStride(comm_of(A), last - first, first, 1, rows.put()));
  Owned<Mat> result;
  check(MatCreateSubMatrix(A, rows, kept_, MAT_INITIAL_MATRIX, result.put()));
  return result;
}

Owned<Vec> Elimination::entries(Vec x) const
{
  Vec part = nullptr;
  check(VecGetSubVector(x, kept_, &part));
  Owned<Vec> result = copy_of(part);
  check(VecRestoreSubVector(x, kept_, &part));
  return result;
}

void name_rows(const MatrixRows& rows, const std::vector<PetscInt>& held, DofNames& names)
{
  for (PetscInt row = 0; row < rows.size; ++row)
  {
    if (std::binary_search(held.begin(), held.end(), row)) continue;
    names.file_rows.push_back(row);
    if (!rows.motions.empty()) names.file_motions.push_back(rows.motions[row]);
  }
}

} // namespace squeal
