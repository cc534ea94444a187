#pragma once
/// The motions at the points of a sweep where modes grow (src/README.md, section 10.6).
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// The sweep that `linear` makes, or the one that was made before a restart, with the motions of the scene's points
/// where modes grow. Groups of ranks seek some of them each. Collective.
Sweep with_motions(const std::function<Sweep()>& linear, const SweepProblem& problem, MPI_Comm comm);

} // namespace squeal
