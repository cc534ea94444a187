#pragma once
/// What the steps of a trajectory leave for the next one, to the last bit, in a checkpoint.
#include "squeal/base/checkpoint.hpp"
#include "squeal/equilibrium/file_order.hpp"
#include "squeal/transient/transient.hpp"

namespace squeal
{

/// One of the trajectories of a checkpoint; `name` begins the names of its lists.
struct KeptTrajectory
{
  std::string name;
  State& state;
  StepWork& work;
};

/// Puts the trajectory into the checkpoint, whole on rank 0. Collective.
void put_trajectory(const KeptTrajectory& trajectory, const FileOrder& order, Checkpoint& checkpoint);

/// Sets state and work, which begin_steps has made, from the checkpoint. Where the run has other ranks than the one
/// that kept it, pairs are numbered otherwise: contact then starts without a memory. Collective.
void take_trajectory(const Checkpoint& checkpoint, const FileOrder& order, const KeptTrajectory& trajectory);

/// The number of ranks of the run at hand, and whether the checkpoint is of as many.
void put_ranks(MPI_Comm comm, Checkpoint& checkpoint);
bool of_these_ranks(const Checkpoint& checkpoint, MPI_Comm comm);

/// Adds the history to the checkpoint.
void put_history(const History& history, Checkpoint& checkpoint);

/// Replaces the history by the checkpoint's.
void take_history(const Checkpoint& checkpoint, History& history);

} // namespace squeal
