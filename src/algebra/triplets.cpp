#include "triplets.hpp"

namespace squeal
{

namespace
{

template <class Keep> void append(Mat matrix, int offset, Keep keep, Triplets& mine)
{
  for_each_row(matrix,
               [&](PetscInt i, std::span<const PetscInt> columns, std::span<const PetscScalar> values)
               {
                 for (std::size_t k = 0; k < columns.size(); ++k)
                 {
                   if (!keep(i, columns[k])) continue;
                   mine.row.push_back(static_cast<int>(offset + i) + 1);
                   mine.column.push_back(static_cast<int>(columns[k]) + 1);
                   mine.value.push_back(values[k]);
                 }
               });
}

template <class T> std::vector<T> gather(const std::vector<T>& mine, MPI_Datatype type, MPI_Comm comm)
{
  const int count = static_cast<int>(mine.size());
  std::vector<int> counts(static_cast<std::size_t>(ranks_of(comm))), starts(counts.size(), 0);
  MPI_Gather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, 0, comm);
  for (std::size_t p = 1; p < counts.size(); ++p) starts[p] = starts[p - 1] + counts[p - 1];
  std::vector<T> all(rank_of(comm) == 0 ? static_cast<std::size_t>(starts.back() + counts.back()) : 0);
  MPI_Gatherv(mine.data(), count, type, all.data(), counts.data(), starts.data(), type, 0, comm);
  return all;
}

} // namespace

Triplets lower_triangle(Mat symmetric)
{
  Triplets mine;
  append_lower_triangle(symmetric, mine);
  return mine;
}

void append_lower_triangle(Mat symmetric, Triplets& mine)
{
  append(
      symmetric, 0, [](PetscInt i, PetscInt j) { return j <= i; }, mine);
}

void append_rows(Mat B, int offset, Triplets& mine)
{
  append(
      B, offset, [](PetscInt, PetscInt) { return true; }, mine);
}

Triplets gathered(Triplets mine, Triplets::Part part, MPI_Comm comm)
{
  if (ranks_of(comm) == 1) return mine;
  Triplets all{gather(mine.row, MPI_INT, comm), gather(mine.column, MPI_INT, comm), {}};
  if (part == Triplets::Part::everything) all.value = gather(mine.value, MPI_DOUBLE, comm);
  return all;
}

} // namespace squeal
