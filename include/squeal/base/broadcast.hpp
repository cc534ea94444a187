#pragma once
/// Broadcast of lists of any length.
#include <algorithm>
#include <mpi.h>
#include <type_traits>
#include <vector>

namespace squeal
{

/// Copies rank 0's list to every rank. Collective. Messages have at most 2^30 bytes because MPI counts are int. T is
/// copied by its bytes.
template <class T> void broadcast(std::vector<T>& list, MPI_Comm comm)
{
  static_assert(std::is_trivially_copyable_v<T>);
  unsigned long long size = list.size();
  MPI_Bcast(&size, 1, MPI_UNSIGNED_LONG_LONG, 0, comm);
  list.resize(size);
  char* bytes = reinterpret_cast<char*>(list.data());
  constexpr std::size_t largest = 1 << 30;
  for (std::size_t sent = 0, total = size * sizeof(T); sent < total; sent += largest)
    MPI_Bcast(bytes + sent, static_cast<int>(std::min(largest, total - sent)), MPI_BYTE, 0, comm);
}

} // namespace squeal
