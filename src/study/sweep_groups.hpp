#pragma once
/// A sweep shared by groups of ranks, each with a model of its own.
#include "lines.hpp"
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// The number of groups to take, at most one a rank and one a point; `wanted` = 0: as many as have memory for a model
/// each, if each gets enough points. Collective.
int groups_of(PetscInt wanted, std::size_t points, MPI_Comm comm);

/// Lines with what was found along each, in order; `ended`: the run was asked to end.
struct VisitedLines
{
  std::vector<SweepLine> lines{};
  std::vector<Sweep> found{};
  bool ended = false;
};

/// Visits each group's share of the points at the same time. Every rank has all of it. What a group throws ends all of
/// them after their work. Collective.
VisitedLines visit_in_groups(const SweepProblem& problem, const std::vector<SweepLine>& lines, int groups,
                             MPI_Comm comm);

} // namespace squeal
