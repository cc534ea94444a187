#include "sweep_groups.hpp"

#include "squeal/base/free_memory.hpp"
#include "squeal/base/run_control.hpp"
#include "sweep_checkpoint.hpp"
#include "sweeper.hpp"

#include <algorithm>
#include <exception>

namespace squeal
{

namespace
{

/// The first rank of a group; behind the last group, the number of ranks.
int first_rank(int group, int groups, int ranks)
{
  return static_cast<int>((static_cast<long>(group) * ranks + groups - 1) / groups);
}

/// The group of this rank; groups hold neighbouring ranks. Collective.
class RankGroup
{
public:
  RankGroup(MPI_Comm comm, int groups)
  {
    const int rank = rank_of(comm), ranks = ranks_of(comm);
    while (first_rank(number_ + 1, groups, ranks) <= rank) ++number_;
    MPI_Comm_split(comm, number_, rank, &comm_);
  }
  RankGroup(const RankGroup&) = delete;
  RankGroup& operator=(const RankGroup&) = delete;
  ~RankGroup() { MPI_Comm_free(&comm_); }

  int number() const { return number_; }
  MPI_Comm comm() const { return comm_; }

private:
  int number_ = 0;
  MPI_Comm comm_ = MPI_COMM_NULL;
};

/// Does the work of this rank's group. Returns false on all ranks if the run was asked to end. Collective.
template <class Work> bool work_in_parts(const RankGroup& group, MPI_Comm comm, Work work)
{
  std::exception_ptr failure;
  try
  {
    const Finally part = work_of_part(group.comm());
    work();
  }
  catch (...)
  {
    failure = std::current_exception();
  }
  agree(comm, failure);
  try
  {
    join_parts(comm);
  }
  catch (const Interrupted&) // of groups that were done, too
  {
    return false;
  }
  return true;
}

} // namespace

int groups_of(PetscInt wanted, std::size_t points, MPI_Comm comm)
{
  constexpr std::size_t fewest = 4; // points of a group: one that another one visits as well costs a quarter more
  const int ranks = ranks_of(comm);
  if (wanted > 0) return std::min({static_cast<int>(wanted), ranks, static_cast<int>(points)});
  const double of_model = peak_memory(comm), free = free_memory(comm); // a model with its modes, as so far
  int groups = static_cast<int>(std::min<std::size_t>(static_cast<std::size_t>(ranks), points / fewest));
  groups = std::min(groups, 1 + static_cast<int>(free / of_model));
  while (groups > 1 && ranks % groups != 0) --groups;
  MPI_Bcast(&groups, 1, MPI_INT, 0, comm);
  return std::max(1, groups);
}

VisitedLines visit_in_groups(const SweepProblem& problem, const std::vector<SweepLine>& lines, int groups,
                             MPI_Comm comm)
{
  const RankGroup group(comm, groups);
  std::vector<Sweep> own;
  VisitedLines visited;
  visited.ended =
      !work_in_parts(group, comm, [&] { own = visit(problem, group.comm(), share_of(lines, group.number(), groups)); });
  for (int g = 0; g < groups; ++g)
  {
    const std::vector<Sweep> theirs = of_rank(first_rank(g, groups, ranks_of(comm)), own, comm);
    const std::vector<SweepLine> share = share_of(lines, g, groups);
    visited.found.insert(visited.found.end(), theirs.begin(), theirs.end());
    visited.lines.insert(visited.lines.end(), share.begin(), share.end());
  }
  return visited;
}

} // namespace squeal
