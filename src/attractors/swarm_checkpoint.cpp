#include "swarm_checkpoint.hpp"

#include "squeal/base/run_control.hpp"
#include "squeal/transient/step_checkpoint.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace squeal
{

namespace
{

constexpr const char* name_of_file = "attractors";

std::string name_of(std::size_t trajectory)
{
  return format("%04zu ", trajectory);
}

void put_watched(const Watched& watched, const std::string& name, Checkpoint& checkpoint)
{
  checkpoint.set(name + "energies", watched.energies);
  checkpoint.set(name + "last", std::vector<double>(watched.last.begin(), watched.last.end()));
  checkpoint.set(name + "squares", std::vector<double>(watched.squares.begin(), watched.squares.end()));
  for (std::size_t i = 0; i < coordinates; ++i)
    checkpoint.set(name + "crossings " + std::to_string(i), watched.crossings[i]);
}

void take_watched(const Checkpoint& checkpoint, const std::string& name, Watched& watched)
{
  watched.energies = checkpoint.list(name + "energies");
  std::ranges::copy(checkpoint.list(name + "last"), watched.last.begin());
  std::ranges::copy(checkpoint.list(name + "squares"), watched.squares.begin());
  for (std::size_t i = 0; i < coordinates; ++i)
    watched.crossings[i] = checkpoint.list(name + "crossings " + std::to_string(i));
}

bool is_of_these_starts(const Checkpoint& checkpoint, const SwarmProgress& progress)
{
  return checkpoint.number("trajectories") == static_cast<double>(progress.states.size()) &&
         std::abs(checkpoint.number("step size") - progress.step_size) <= 1e-9 * progress.step_size;
}

} // namespace

void keep_swarm(const SwarmProgress& progress)
{
  checkpoint_made();
  if (!checkpoints_are_kept()) return;
  const MPI_Comm comm = comm_of(progress.structure.load);
  Checkpoint checkpoint;
  put_ranks(comm, checkpoint);
  checkpoint.set("trajectories", static_cast<double>(progress.states.size()));
  checkpoint.set("step size", progress.step_size);
  checkpoint.set("steps", static_cast<double>(progress.steps));
  const FileOrder order(progress.structure);
  for (std::size_t k = 0; k < progress.states.size(); ++k)
  {
    put_trajectory({name_of(k), progress.states[k], progress.works[k]}, order, checkpoint);
    put_watched(progress.watched[k], name_of(k), checkpoint);
  }
  if (rank_of(comm) == 0) keep(checkpoint, name_of_file);
}

void restore_swarm(const SwarmProgress& progress)
{
  const MPI_Comm comm = comm_of(progress.structure.load);
  const auto checkpoint = kept_everywhere(name_of_file, comm);
  if (!checkpoint || !is_of_these_starts(*checkpoint, progress)) return;
  progress.steps = static_cast<long>(checkpoint->number("steps"));
  const FileOrder order(progress.structure);
  for (std::size_t k = 0; k < progress.states.size(); ++k)
  {
    take_trajectory(*checkpoint, order, {name_of(k), progress.states[k], progress.works[k]});
    take_watched(*checkpoint, name_of(k), progress.watched[k]);
  }
  if (rank_of(comm) == 0) std::printf("  goes on from the checkpoint after %ld steps\n", progress.steps);
}

} // namespace squeal
