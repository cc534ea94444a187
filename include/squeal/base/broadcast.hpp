#pragma once
/// Messages of lists and texts of any length: each has at most 2^30 bytes because MPI counts are int. Entries are
/// copied by their bytes.
#include <algorithm>
#include <mpi.h>
#include <type_traits>

namespace squeal
{

/// Calls pass(bytes, count) for parts of the list that fit a message.
template <class List, class Pass> void by_messages(List& list, Pass pass)
{
  using Value = typename List::value_type;
  static_assert(std::is_trivially_copyable_v<Value>);
  auto* const bytes = reinterpret_cast<char*>(const_cast<Value*>(list.data()));
  constexpr std::size_t largest = 1 << 30;
  for (std::size_t passed = 0, total = list.size() * sizeof(Value); passed < total; passed += largest)
    pass(bytes + passed, static_cast<int>(std::min(largest, total - passed)));
}

/// Copies one rank's list, a vector or a string, to every rank. Collective.
template <class List> void broadcast(List& list, MPI_Comm comm, int from = 0)
{
  unsigned long long size = list.size();
  MPI_Bcast(&size, 1, MPI_UNSIGNED_LONG_LONG, from, comm);
  list.resize(size);
  by_messages(list, [&](char* bytes, int count) { MPI_Bcast(bytes, count, MPI_BYTE, from, comm); });
}

/// To a rank that receives a list of the same type.
template <class List> void send(const List& list, int to, MPI_Comm comm)
{
  const unsigned long long size = list.size();
  MPI_Send(&size, 1, MPI_UNSIGNED_LONG_LONG, to, 0, comm);
  by_messages(list, [&](const char* bytes, int count) { MPI_Send(bytes, count, MPI_BYTE, to, 0, comm); });
}

/// Replaces the list by what the other rank sends.
template <class List> void receive(List& list, int from, MPI_Comm comm)
{
  unsigned long long size = 0;
  MPI_Recv(&size, 1, MPI_UNSIGNED_LONG_LONG, from, 0, comm, MPI_STATUS_IGNORE);
  list.resize(size);
  by_messages(list,
              [&](char* bytes, int count) { MPI_Recv(bytes, count, MPI_BYTE, from, 0, comm, MPI_STATUS_IGNORE); });
}

} // namespace squeal
