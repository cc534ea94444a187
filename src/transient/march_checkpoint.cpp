#include "march_checkpoint.hpp"

#include "squeal/base/run_control.hpp"
#include "squeal/transient/step_checkpoint.hpp"

#include <cmath>

namespace squeal
{

namespace
{

constexpr const char* name_of_file = "transient";

/// By which the structure is recognised.
std::vector<double> marks_of(const Structure& structure, const MarchPlan& plan)
{
  double stiffness = 0, mass = 0;
  check(MatNorm(structure.K, NORM_FROBENIUS, &stiffness));
  check(MatNorm(structure.M, NORM_FROBENIUS, &mass));
  return {static_cast<double>(plan.steps), plan.step_size, plan.theta, stiffness, mass};
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
    put_trajectory({"", progress.state, progress.work}, FileOrder(structure_), checkpoint);
    if (rank_of(comm_of(structure_.load)) == 0) squeal::keep(checkpoint, name_of_file);
  }
  checkpoint_made();
}

Checkpoint MarchCheckpoint::made(const MarchProgress& progress) const
{
  Checkpoint checkpoint;
  checkpoint.set("marks", marks_of(structure_, plan_));
  put_ranks(comm_of(structure_.load), checkpoint);
  const MarchSummary& summary = progress.summary;
  checkpoint.set("summary",
                 std::vector<double>{static_cast<double>(summary.steps), static_cast<double>(summary.unconverged),
                                     summary.first_unconverged, summary.contact_residual_max, summary.energy_defect_max,
                                     progress.iterations, slides_ ? 1. : 0., summary.fall_of_friction_max,
                                     static_cast<double>(summary.as_one)});
  checkpoint.set("amplitude time", amplitude_.time);
  checkpoint.set("amplitude logarithm", amplitude_.log_modulus);
  put_history(progress.history, checkpoint);
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
  take_trajectory(checkpoint, FileOrder(structure_), {"", progress.state, progress.work});
  const std::vector<double>& summary = checkpoint.list("summary");
  progress.summary.steps = static_cast<long>(summary.at(0));
  progress.summary.unconverged = static_cast<long>(summary.at(1));
  progress.summary.first_unconverged = summary.at(2);
  progress.summary.contact_residual_max = summary.at(3);
  progress.summary.energy_defect_max = summary.at(4);
  progress.iterations = summary.at(5);
  slides_ = summary.at(6) != 0;
  progress.summary.fall_of_friction_max = summary.at(7);
  progress.summary.as_one = summary.size() > 8 ? static_cast<long>(summary[8]) : 0;
  amplitude_.time = checkpoint.list("amplitude time");
  amplitude_.log_modulus = checkpoint.list("amplitude logarithm");
  take_history(checkpoint, progress.history);
}

} // namespace squeal
