#pragma once
/// Lists and texts of any length to all ranks: a message has at most 2^30 bytes because MPI counts are int. Entries are
/// copied by their bytes.
#include <algorithm>
#include <mpi.h>
#include <type_traits>

namespace squeal
{

/// Copies one rank's list, a vector or a string, to every rank. Collective.
template <class List> void broadcast(List& list, MPI_Comm comm, int from = 0)
{
  unsigned long long size = list.size();
  MPI_Bcast(&size, 1, MPI_UNSIGNED_LONG_LONG, from, comm);
  list.resize(size);
  using Value = typename List::value_type;
  static_assert(std::is_trivially_copyable_v<Value>);
  constexpr std::size_t largest = 1 << 30;
  auto* const bytes = reinterpret_cast<char*>(list.data());
  for (std::size_t passed = 0, total = list.size() * sizeof(Value); passed < total; passed += largest)
    MPI_Bcast(bytes + passed, static_cast<int>(std::min(largest, total - passed)), MPI_BYTE, from, comm);
}

} // namespace squeal
