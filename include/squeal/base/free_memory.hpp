#pragma once
/// Memory that a run can still take, what it gives back, and arrays on large pages.

#include <cmath>
#include <fstream>
#include <mpi.h>
#include <optional>
#include <string>
#include <vector>

namespace squeal
{

/// Memory that all nodes together and the limits of their control groups leave [byte]. Collective.
double free_memory(MPI_Comm comm);

/// Returns to the system the pages that freed arrays leave within the heap. The GNU allocator keeps them: at 239 246
/// degrees of freedom 3.5 of 4.0 GB after the equilibrium, where nothing that comes later has their sizes. Not
/// collective.
void return_freed_memory();

/// An empty vector with room for `count` numbers on pages of 2 MB, where Linux has them, for what every step reads from
/// end to end. The processor does not prefetch beyond a page: with pages of 4 kB reading takes half as long again. Such
/// pages are cleared when they are first touched, which does not pay for short-lived arrays.
std::vector<double> vector_on_large_pages(std::size_t count);

// Memory as the system tells it. This header knows no MPI, because the mesher knows none.

/// An entry of a file such as /proc/meminfo [byte]; nothing where there is none.
inline std::optional<double> memory_entry(const char* file, const char* key)
{
  std::ifstream entries(file);
  double kilobytes = 0;
  for (std::string word; entries >> word;)
    if (word == key && entries >> kilobytes) return 1024 * kilobytes;
  return {};
}

/// MemAvailable [byte]; infinite where the system does not say.
inline double available_memory()
{
  return memory_entry("/proc/meminfo", "MemAvailable:").value_or(HUGE_VAL);
}

} // namespace squeal
