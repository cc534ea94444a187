#pragma once
/// Broadcast of lists and texts of any length.
#include <algorithm>
#include <mpi.h>
#include <type_traits>

namespace squeal
{

/// Copies one rank's list, a vector or a string, to every rank. Collective. Messages have at most 2^30 bytes because
/// MPI counts are int. Entries are copied by their bytes.
template <class List> void broadcast(List& list, MPI_Comm comm, int from = 0)
{
  using Entry = typename List::value_type;
  static_assert(std::is_trivially_copyable_v<Entry>);
  unsigned long long size = list.size();
  MPI_Bcast(&size, 1, MPI_UNSIGNED_LONG_LONG, from, comm);
  list.resize(size);
  char* bytes = reinterpret_cast<char*>(list.data());
  constexpr std::size_t largest = 1 << 30;
  for (std::size_t sent = 0, total = size * sizeof(Entry); sent < total; sent += largest)
    MPI_Bcast(bytes + sent, static_cast<int>(std::min(largest, total - sent)), MPI_BYTE, from, comm);
}

} // namespace squeal
