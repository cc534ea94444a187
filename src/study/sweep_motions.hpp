#pragma once
/// The motions at the points of a sweep where modes grow (src/README.md, section 10.6).
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// The sweep that `linear` makes, with the motions of the scene's points where modes grow; those that were known before
/// a restart are taken. Groups of ranks seek some of them each. Collective.
Sweep with_motions(const std::function<Sweep()>& linear, const SweepProblem& problem, MPI_Comm comm);

} // namespace squeal
