#pragma once
/// Memory that a run can still take.
#include <mpi.h>

namespace squeal
{

/// What all nodes together and the limits of their control groups leave [byte]. Collective.
double free_memory(MPI_Comm comm);

} // namespace squeal
