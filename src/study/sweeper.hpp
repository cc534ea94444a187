#pragma once
/// A share of a sweep's points, visited line by line: modes are followed, and thresholds are sought on the way
/// (src/README.md, sections 10.1 to 10.5).
#include "lines.hpp"
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// Visits the points of each line. Collective. outcome: "interrupted" where the run was asked to end, else "converged";
/// the points done stay. Each line has tracks of its own.
std::vector<Sweep> visit(const SweepProblem& problem, MPI_Comm comm, const std::vector<SweepLine>& lines);

} // namespace squeal
