#pragma once
/// The state of a trajectory and its history, in a checkpoint.
#include "squeal/equilibrium/file_order.hpp"
#include "squeal/transient/transient.hpp"

namespace squeal
{

/// The reactions of as many ranks: on another number of ranks pairs are numbered otherwise, and they are left alone.
void describe_reactions(Checkpoint& checkpoint, MPI_Comm comm, std::vector<double>& reactions);

/// The state, whole on rank 0. Collective.
void describe_state(Checkpoint& checkpoint, const FileOrder& order, State& state);

void describe(Checkpoint& checkpoint, History& history);

} // namespace squeal
