#include "squeal/transient/step_checkpoint.hpp"

namespace squeal
{

void describe_reactions(Checkpoint& checkpoint, MPI_Comm comm, std::vector<double>& reactions)
{
  int ranks = ranks_of(comm);
  std::vector<double> kept = reactions;
  describe_all(checkpoint, ranks, kept);
  if (ranks == ranks_of(comm)) reactions = std::move(kept);
}

void describe_state(Checkpoint& checkpoint, const FileOrder& order, State& state)
{
  order.describe(checkpoint, state.u);
  order.describe(checkpoint, state.v);
  describe(checkpoint, state.time);
  describe_reactions(checkpoint, comm_of(state.u), state.reactions);
}

void describe(Checkpoint& checkpoint, History& history)
{
  describe_all(checkpoint, history.time, history.energy, history.fluctuating_energy, history.damping_power,
               history.contact_power, history.load_power, history.drive_power, history.normal_force, history.open,
               history.stick, history.slip, history.probes);
}

} // namespace squeal
