#include "triplets.hpp"

#include "squeal/base/error.hpp"

namespace squeal
{

namespace
{

/// Appends the entries (i, j) of this rank for which `keep` holds, i below row `offset`: this `part` of all of them, on
/// average of the ranks.
template <class Keep> void append(Mat matrix, PetscInt offset, Keep keep, double part, Triplets& entries)
{
  MatInfo info;
  check(MatGetInfo(matrix, MAT_LOCAL, &info));
  const std::size_t expected = entries.row.size() + static_cast<std::size_t>(part * info.nz_used) + 1;
  entries.row.reserve(expected);
  entries.column.reserve(expected);
  entries.value.reserve(expected);
  (void)to_int(offset + row_count(matrix));
  (void)to_int(column_count(matrix));
  for_each_row(matrix,
               [&](PetscInt i, std::span<const PetscInt> column, std::span<const PetscScalar> value)
               {
                 for (std::size_t k = 0; k < column.size(); ++k)
                 {
                   if (!keep(i, column[k])) continue;
                   entries.row.push_back(static_cast<int>(offset + i) + 1);
                   entries.column.push_back(static_cast<int>(column[k]) + 1);
                   entries.value.push_back(value[k]);
                 }
               });
}

template <class T> std::vector<T> gather(const std::vector<T>& own, MPI_Datatype type, MPI_Comm comm)
{
  const int count = to_int(own.size());
  std::vector<int> counts(static_cast<std::size_t>(ranks_of(comm))), starts(counts.size(), 0);
  MPI_Gather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, 0, comm);
  for (std::size_t p = 1; p < counts.size(); ++p) starts[p] = starts[p - 1] + counts[p - 1];
  std::vector<T> all(rank_of(comm) == 0 ? static_cast<std::size_t>(starts.back() + counts.back()) : 0);
  MPI_Gatherv(own.data(), count, type, all.data(), counts.data(), starts.data(), type, 0, comm);
  return all;
}

} // namespace

Triplets lower_triangle(Mat symmetric)
{
  constexpr double half = 0.52; // and the diagonal
  Triplets entries;
  append(
      symmetric, 0, [](PetscInt i, PetscInt j) { return j <= i; }, half, entries);
  return entries;
}

void append_rows(Mat B, PetscInt offset, Triplets& entries)
{
  append(
      B, offset, [](PetscInt, PetscInt) { return true; }, 1, entries);
}

Triplets gather(Triplets entries, MPI_Comm comm)
{
  if (ranks_of(comm) == 1) return entries;
  auto total = static_cast<long long>(entries.row.size());
  MPI_Allreduce(MPI_IN_PLACE, &total, 1, MPI_LONG_LONG, MPI_SUM, comm);
  (void)to_int(total);
  return {gather(entries.row, MPI_INT, comm), gather(entries.column, MPI_INT, comm),
          gather(entries.value, MPI_DOUBLE, comm)};
}

} // namespace squeal
