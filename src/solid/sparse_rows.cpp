#include "squeal/solid/sparse_rows.hpp"

#include "squeal/base/packed.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

void add_displacement(const DofMap& dofs, int node, const Vec3& direction, SparseRow& row)
{
  for (int c = 0; c < 3; ++c)
    for (const DofTerm& term : dofs.terms_of(6 * PetscInt{node} + c)) row[term.dof] += direction[c] * term.factor;
}

std::vector<SparseRow> scattered_rows(std::vector<SparseRow> rows, PetscInt count, MPI_Comm comm)
{
  const std::size_t of_item = count > 0 ? rows.size() / static_cast<std::size_t>(count) : 0;
  const auto rows_of = [&](int rank)
  {
    const auto [first, last] = range_of(count, rank, ranks_of(comm));
    return std::span(rows).subspan(static_cast<std::size_t>(first) * of_item,
                                   static_cast<std::size_t>(last - first) * of_item);
  };
  if (rank_of(comm) == 0)
  {
    for (int to = 1; to < ranks_of(comm); ++to)
    {
      const std::span<const SparseRow> others = rows_of(to);
      send(packed(std::vector<SparseRow>(others.begin(), others.end())), to, comm);
    }
    rows.resize(rows_of(0).size());
    return rows;
  }
  std::string received;
  receive(received, 0, comm);
  return unpacked<std::vector<SparseRow>>(received);
}

Owned<Mat> matrix_of_rows(const std::vector<SparseRow>& rows, PetscInt local_columns, MPI_Comm comm)
{
  std::vector<PetscInt> offsets{0}, columns;
  std::vector<double> values;
  for (const SparseRow& row : rows)
  {
    for (const auto& [column, value] : row)
    {
      if (std::abs(value) < 1e-14) continue; // direction cosines and lever arms [m] that cancelled up to round-off
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

std::pair<PetscInt, PetscInt> local_range(PetscInt count, MPI_Comm comm)
{
  return range_of(count, rank_of(comm), ranks_of(comm));
}

std::pair<PetscInt, PetscInt> range_of(PetscInt count, PetscInt rank, PetscInt ranks)
{
  const PetscInt size = count / ranks, rest = count % ranks;
  const PetscInt first = rank * size + std::min(rank, rest);
  return {first, first + size + (rank < rest ? 1 : 0)};
}

} // namespace squeal
