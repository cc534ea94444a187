#pragma once
/// The points of a sweep that is not finished, as a checkpoint.
#include "squeal/base/checkpoint.hpp"
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// The points, without their motions, and the thresholds.
void describe(Checkpoint& checkpoint, Sweep& sweep);

void describe(Checkpoint& checkpoint, SweptMotion& motion);

/// Keeps the points so far under a name. Collective.
void keep_sweep(const Sweep& sweep, const std::string& name, MPI_Comm comm);

/// The points to go on from; none where the run begins. Collective.
Sweep kept_sweep(const std::string& name, MPI_Comm comm);

} // namespace squeal
