#pragma once
/// A sweep shared by groups of ranks: each has a model of its own, and all their points make one sweep in the end.
#include "lines.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// What is shared among groups.
struct SharedPoints
{
  std::size_t points = 0, fewest = 1; // that a group is worth
};

/// The number of groups to take, at most one a rank and one a point; `wanted` = 0: as many as have memory for a model
/// each, if each gets enough points. Collective.
int groups_of(PetscInt wanted, const SharedPoints& shared, MPI_Comm comm);

/// The first rank of a group; behind the last group, the number of ranks.
int first_rank(int group, int groups, int ranks);

/// The group of this rank; groups hold neighbouring ranks. Collective.
class RankGroup
{
public:
  RankGroup(MPI_Comm comm, int groups);
  RankGroup(const RankGroup&) = delete;
  RankGroup& operator=(const RankGroup&) = delete;
  ~RankGroup() { MPI_Comm_free(&comm_); }

  int number() const { return number_; }
  MPI_Comm comm() const { return comm_; }

private:
  int number_ = 0;
  MPI_Comm comm_ = MPI_COMM_NULL;
};

/// Does the work of this rank's group. What any group throws ends all of them after their work. Returns false on all
/// ranks if the run was asked to end. Collective.
bool work_in_parts(const RankGroup& group, MPI_Comm comm, const std::function<void()>& work);

/// Every group's part, on every rank. Collective.
std::vector<Sweep> shared(const Sweep& own, const RankGroup& group, int groups, MPI_Comm comm);

/// One sweep of the parts. A part's tracks get the numbers that the first modes of each of its lines have elsewhere.
Sweep joined(const std::vector<Sweep>& parts, const std::vector<std::vector<SweepLine>>& shares);

} // namespace squeal
