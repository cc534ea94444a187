#include "squeal/transient/step_checkpoint.hpp"

#include <array>

namespace squeal
{

namespace
{

/// The vectors that a step leaves for the next one.
std::array<std::pair<const char*, Vec>, 5> vectors_of(const KeptTrajectory& trajectory)
{
  return {{{"u", trajectory.state.u},
           {"v", trajectory.state.v},
           {"Mv", trajectory.work.Mv},
           {"Av", trajectory.work.Av},
           {"Ku", trajectory.work.Ku}}};
}

/// Visits every list of a history but the probes' by its name.
template <class Some, class Visit> void for_each_list(Some& history, Visit visit)
{
  visit("time", history.time);
  visit("energy", history.energy);
  visit("fluctuating_energy", history.fluctuating_energy);
  visit("damping_power", history.damping_power);
  visit("contact_power", history.contact_power);
  visit("load_power", history.load_power);
  visit("drive_power", history.drive_power);
  visit("normal_force", history.normal_force);
  visit("open", history.open);
  visit("stick", history.stick);
  visit("slip", history.slip);
}

std::string numbered(const std::string& name, std::size_t i)
{
  return name + " " + std::to_string(i);
}

/// Of the reactions, on rank 0.
void take_memory(const Checkpoint& checkpoint, const std::string& name, ContactMemory& memory)
{
  memory.since_read = static_cast<int>(checkpoint.number(name + "unread"));
  for (std::size_t i = 0; checkpoint.has(numbered(name + "memory r", i)); ++i)
  {
    memory.r.push_back(checkpoint.list(numbered(name + "memory r", i)));
    memory.Wr.push_back(checkpoint.list(numbered(name + "memory Wr", i)));
  }
}

} // namespace

void put_ranks(MPI_Comm comm, Checkpoint& checkpoint)
{
  checkpoint.set("ranks", ranks_of(comm));
}

bool of_these_ranks(const Checkpoint& checkpoint, MPI_Comm comm)
{
  return static_cast<int>(checkpoint.number("ranks")) == ranks_of(comm);
}

void put_trajectory(const KeptTrajectory& trajectory, const FileOrder& order, Checkpoint& checkpoint)
{
  const auto& [name, state, work] = trajectory;
  for (const auto& [part, x] : vectors_of(trajectory)) checkpoint.set(name + part, order.gather(x));
  checkpoint.set(name + "time", state.time);
  checkpoint.set(name + "reactions", state.reactions);
  checkpoint.set(name + "energy", work.energy);
  checkpoint.set(name + "unread", work.memory.since_read);
  for (std::size_t i = 0; i < work.memory.r.size(); ++i)
  {
    checkpoint.set(numbered(name + "memory r", i), work.memory.r[i]);
    checkpoint.set(numbered(name + "memory Wr", i), work.memory.Wr[i]);
  }
}

void take_trajectory(const Checkpoint& checkpoint, const FileOrder& order, const KeptTrajectory& trajectory)
{
  const auto& [name, state, work] = trajectory;
  for (const auto& [part, x] : vectors_of(trajectory)) order.scatter(checkpoint.list(name + part), x);
  state.time = checkpoint.number(name + "time");
  work.energy = checkpoint.number(name + "energy");
  const MPI_Comm comm = comm_of(state.u);
  if (!of_these_ranks(checkpoint, comm)) return;
  state.reactions = checkpoint.list(name + "reactions");
  work.memory = {};
  if (rank_of(comm) == 0) take_memory(checkpoint, name, work.memory);
}

void put_history(const History& history, Checkpoint& checkpoint)
{
  const auto put = [&](const std::string& name, const auto& list) { checkpoint.set("history " + name, list); };
  for_each_list(history, put);
  for (std::size_t i = 0; i < history.probes.size(); ++i) put(numbered("probe", i), history.probes[i]);
}

void take_history(const Checkpoint& checkpoint, History& history)
{
  for_each_list(history,
                [&](const std::string& name, auto& list)
                {
                  const std::vector<double>& values = checkpoint.list("history " + name);
                  list.assign(values.begin(), values.end());
                });
  history.probes.clear();
  for (std::size_t i = 0; checkpoint.has(numbered("history probe", i)); ++i)
    history.probes.push_back(checkpoint.list(numbered("history probe", i)));
}

} // namespace squeal
