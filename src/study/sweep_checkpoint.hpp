#pragma once
/// The points of a sweep that is not finished, as a checkpoint.
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// Keeps the points so far. Collective.
void keep_sweep(const Sweep& sweep, MPI_Comm comm);

/// The points to go on from; none where the run begins. Collective.
Sweep kept_sweep(MPI_Comm comm);

} // namespace squeal
