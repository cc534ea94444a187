#pragma once
/// The points of a sweep, visited line by line: modes are followed, and thresholds are sought on the way
/// (src/README.md, sections 10.1 to 10.5).
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// Points along the number in one direction of rotation; or design points.
struct SweepLine
{
  std::vector<std::vector<double>> points; // values of the numbers
  bool reversed = false;                   // direction of rotation
  bool ordered = true; // modes can be followed from point to point; else they are named by the first
};

/// Visits the points of each line. Collective. outcome: "interrupted" where the run was asked to end, else "converged";
/// the points done stay. Each line has tracks of its own.
std::vector<Sweep> visit(const SweepProblem& problem, MPI_Comm comm, const std::vector<SweepLine>& lines);

} // namespace squeal
