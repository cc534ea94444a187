#pragma once
/// Memory that a run can still take, and what it gives back.
#include <mpi.h>

namespace squeal
{

/// What all nodes together and the limits of their control groups leave [byte]. Collective.
double free_memory(MPI_Comm comm);

/// Returns to the system the pages that freed arrays leave within the heap. The GNU allocator keeps them: at 239 246
/// degrees of freedom 3.5 of 4.0 GB after the equilibrium, where nothing that comes later has their sizes. Not
/// collective.
void return_freed_memory();

} // namespace squeal
