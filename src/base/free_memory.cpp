#include "squeal/base/free_memory.hpp"

#include "squeal/base/available_memory.hpp"
#include "squeal/base/petsc.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#ifdef __linux__
#include <cstdint>
#include <sys/mman.h>
#endif

namespace squeal
{

namespace
{

/// Memory that the node and the limits of its control group leave [byte].
double free_memory_of_node()
{
  double cgroup = HUGE_VAL, used = 0;
  std::ifstream limit("/sys/fs/cgroup/memory.max"), usage("/sys/fs/cgroup/memory.current");
  if (!(limit >> cgroup)) cgroup = HUGE_VAL; // also the word "max"
  usage >> used;
  return std::min(available_memory(), cgroup - used);
}

} // namespace

double free_memory(MPI_Comm comm)
{
  MPI_Comm node = MPI_COMM_NULL;
  MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node);
  double bytes = rank_of(node) == 0 ? free_memory_of_node() : 0;
  MPI_Comm_free(&node);
  MPI_Allreduce(MPI_IN_PLACE, &bytes, 1, MPI_DOUBLE, MPI_SUM, comm);
  return bytes;
}

void return_freed_memory()
{
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

std::vector<double> vector_on_large_pages(std::size_t count)
{
  std::vector<double> array;
  array.reserve(count);
#ifdef MADV_HUGEPAGE
  constexpr std::uintptr_t page = 4096;
  const auto start = (reinterpret_cast<std::uintptr_t>(array.data()) + page - 1) / page * page;
  const auto end = reinterpret_cast<std::uintptr_t>(array.data() + count) / page * page;
  // The system may refuse; the array then has small pages.
  if (end > start) (void)madvise(reinterpret_cast<void*>(start), end - start, MADV_HUGEPAGE);
#endif
  return array;
}

} // namespace squeal
