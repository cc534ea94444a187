#include "swarm_checkpoint.hpp"

#include "squeal/base/run_control.hpp"
#include "squeal/transient/step_checkpoint.hpp"

#include <cmath>
#include <cstdio>

namespace squeal
{

void describe(Checkpoint& checkpoint, Watched& watched)
{
  describe_all(checkpoint, watched.energies, watched.last, watched.squares, watched.crossings);
}

namespace
{

constexpr const char* name_of_file = "attractors";

/// Writes or reads the trajectories; false: the checkpoint is of other starts.
bool describe_swarm(Checkpoint& checkpoint, const SwarmProgress& progress)
{
  std::size_t trajectories = progress.states.size();
  double step_size = progress.step_size;
  describe_all(checkpoint, trajectories, step_size);
  const bool same_step = std::abs(step_size - progress.step_size) <= 1e-9 * progress.step_size;
  if (trajectories != progress.states.size() || !same_step) return false;
  describe_all(checkpoint, progress.steps, progress.watched);
  const FileOrder order(progress.structure);
  for (State& state : progress.states) describe_state(checkpoint, order, state);
  return true;
}

} // namespace

void keep_swarm(const SwarmProgress& progress)
{
  checkpoint_made();
  if (!checkpoints_are_kept()) return;
  Checkpoint checkpoint;
  describe_swarm(checkpoint, progress);
  if (rank_of(comm_of(progress.structure.load)) == 0) keep(checkpoint, name_of_file);
}

void restore_swarm(const SwarmProgress& progress)
{
  const MPI_Comm comm = comm_of(progress.structure.load);
  std::optional<Checkpoint> checkpoint = kept_everywhere(name_of_file, comm);
  if (checkpoint && describe_swarm(*checkpoint, progress) && rank_of(comm) == 0)
    std::printf("  goes on from the checkpoint after %ld steps\n", progress.steps);
}

} // namespace squeal
