#pragma once
/// A share of a sweep's points, visited line by line: modes are followed, and thresholds are sought on the way
/// (src/README.md, sections 10.1 to 10.5).
#include "lines.hpp"
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// Visits all points of these lines. Collective. outcome: "interrupted" where the run was asked to end, else
/// "converged"; the points done stay.
Sweep visit(const SweepProblem& problem, MPI_Comm comm, const std::vector<SweepLine>& lines);

} // namespace squeal
