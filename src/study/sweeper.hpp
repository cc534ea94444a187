#pragma once
/// A share of a sweep's points, visited line by line: modes are followed, and thresholds are sought on the way
/// (src/README.md, sections 10.1 to 10.5).
#include "lines.hpp"
#include "squeal/study/sweep.hpp"

#include <string>

namespace squeal
{

/// Where a share of the points is visited, and the name of its checkpoint.
struct SharePlace
{
  MPI_Comm comm;
  bool of_part; // of the ranks
  std::string checkpoint;
};

/// Visits all points of these lines, after those that the checkpoint holds. Collective. outcome: "interrupted" where
/// the run was asked to end, else "converged"; the points done are in the checkpoint, too.
Sweep visit(const SweepProblem& problem, const SharePlace& place, const std::vector<SweepLine>& lines);

} // namespace squeal
