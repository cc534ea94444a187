#include "march_checkpoint.hpp"

#include "squeal/base/run_control.hpp"
#include "squeal/equilibrium/file_order.hpp"

#include <array>
#include <cmath>

namespace squeal
{

namespace
{

constexpr const char* name_of_file = "transient";

/// The vectors that a step leaves for the next one.
std::array<std::pair<const char*, Vec>, 5> vectors_of(const MarchProgress& progress)
{
  return {{{"u", progress.state.u},
           {"v", progress.state.v},
           {"Mv", progress.work.Mv},
           {"Av", progress.work.Av},
           {"Ku", progress.work.Ku}}};
}

/// Visits every list of a history by its name.
template <class Some, class Visit> void for_each_list(Some& history, Visit visit)
{
  visit("time", history.time);
  visit("energy", history.energy);
  visit("fluctuating_energy", history.fluctuating_energy);
  visit("damping_power", history.damping_power);
  visit("contact_power", history.contact_power);
  visit("load_power", history.load_power);
  visit("normal_force", history.normal_force);
  visit("open", history.open);
  visit("stick", history.stick);
  visit("slip", history.slip);
  for (std::size_t i = 0; i < history.probes.size(); ++i) visit("probe " + std::to_string(i), history.probes[i]);
}

/// By which the structure is recognised.
std::vector<double> marks_of(const Structure& structure, const MarchPlan& plan)
{
  double stiffness = 0, mass = 0;
  check(MatNorm(structure.K, NORM_FROBENIUS, &stiffness));
  check(MatNorm(structure.M, NORM_FROBENIUS, &mass));
  return {static_cast<double>(plan.steps), plan.step_size, plan.theta, stiffness, mass};
}

/// Of the reactions, on rank 0.
void read_memory(const Checkpoint& checkpoint, ContactMemory& memory)
{
  memory.since_read = static_cast<int>(checkpoint.number("work unread"));
  for (std::size_t i = 0; checkpoint.has("memory r " + std::to_string(i)); ++i)
  {
    memory.r.push_back(checkpoint.list("memory r " + std::to_string(i)));
    memory.Wr.push_back(checkpoint.list("memory Wr " + std::to_string(i)));
  }
}

/// To the rounding of another number of ranks.
bool agree(const std::vector<double>& a, const std::vector<double>& b)
{
  for (std::size_t i = 0; i < a.size(); ++i)
    if (i >= b.size() || std::abs(a[i] - b[i]) > 1e-9 * std::abs(b[i])) return false;
  return true;
}

} // namespace

MarchCheckpoint::MarchCheckpoint(const Structure& structure, const MarchPlan& plan, ModeAmplitude& amplitude,
                                 bool& slides)
    : structure_(structure), plan_(plan), amplitude_(amplitude), slides_(slides)
{
}

void MarchCheckpoint::keep(const MarchProgress& progress) const
{
  if (checkpoints_are_kept())
  {
    Checkpoint checkpoint = made(progress);
    const FileOrder order(structure_);
    for (const auto& [name, x] : vectors_of(progress)) checkpoint.set(name, order.gather(x));
    if (rank_of(comm_of(structure_.load)) == 0) squeal::keep(checkpoint, name_of_file);
  }
  checkpoint_made();
}

Checkpoint MarchCheckpoint::made(const MarchProgress& progress) const
{
  Checkpoint checkpoint;
  checkpoint.set("marks", marks_of(structure_, plan_));
  checkpoint.set("ranks", ranks_of(comm_of(structure_.load)));
  checkpoint.set("state time", progress.state.time);
  checkpoint.set("reactions", progress.state.reactions);
  checkpoint.set("work energy", progress.work.energy);
  checkpoint.set("work unread", progress.work.memory.since_read);
  for (std::size_t i = 0; i < progress.work.memory.r.size(); ++i)
  {
    checkpoint.set("memory r " + std::to_string(i), progress.work.memory.r[i]);
    checkpoint.set("memory Wr " + std::to_string(i), progress.work.memory.Wr[i]);
  }
  const MarchSummary& summary = progress.summary;
  checkpoint.set("summary",
                 std::vector<double>{static_cast<double>(summary.steps), static_cast<double>(summary.unconverged),
                                     summary.first_unconverged, summary.contact_residual_max, summary.energy_defect_max,
                                     progress.iterations, slides_ ? 1. : 0., summary.fall_of_friction_max});
  checkpoint.set("amplitude time", amplitude_.time);
  checkpoint.set("amplitude logarithm", amplitude_.log_modulus);
  for_each_list(progress.history, [&](const std::string& name, const auto& list) { checkpoint.set(name, list); });
  return checkpoint;
}

void MarchCheckpoint::restore(const MarchProgress& progress) const
{
  const MPI_Comm comm = comm_of(structure_.load);
  const auto checkpoint = kept_everywhere(name_of_file, comm);
  if (!checkpoint || !agree(checkpoint->list("marks"), marks_of(structure_, plan_))) return;
  read(*checkpoint, progress);
  if (rank_of(comm) == 0)
    std::printf("  goes on from the checkpoint after %ld of %ld steps\n", progress.summary.steps, plan_.steps);
}

void MarchCheckpoint::read(const Checkpoint& checkpoint, const MarchProgress& progress) const
{
  const FileOrder order(structure_);
  for (const auto& [name, x] : vectors_of(progress)) order.scatter(checkpoint.list(name), x);
  progress.state.time = checkpoint.number("state time");
  progress.work.energy = checkpoint.number("work energy");
  // Pairs are numbered otherwise on other ranks: contact then starts without a memory.
  if (static_cast<int>(checkpoint.number("ranks")) == ranks_of(comm_of(structure_.load)))
  {
    progress.state.reactions = checkpoint.list("reactions");
    progress.work.memory = {};
    if (rank_of(comm_of(structure_.load)) == 0) read_memory(checkpoint, progress.work.memory);
  }
  const std::vector<double>& summary = checkpoint.list("summary");
  progress.summary.steps = static_cast<long>(summary.at(0));
  progress.summary.unconverged = static_cast<long>(summary.at(1));
  progress.summary.first_unconverged = summary.at(2);
  progress.summary.contact_residual_max = summary.at(3);
  progress.summary.energy_defect_max = summary.at(4);
  progress.iterations = summary.at(5);
  slides_ = summary.at(6) != 0;
  progress.summary.fall_of_friction_max = summary.at(7);
  amplitude_.time = checkpoint.list("amplitude time");
  amplitude_.log_modulus = checkpoint.list("amplitude logarithm");
  for_each_list(progress.history,
                [&](const std::string& name, auto& list)
                {
                  const std::vector<double>& values = checkpoint.list(name);
                  list.assign(values.begin(), values.end());
                });
}

} // namespace squeal
