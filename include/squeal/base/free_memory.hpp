#pragma once
/// Memory that a run can still take, what it gives back, and arrays on large pages.
#include <mpi.h>
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

} // namespace squeal
