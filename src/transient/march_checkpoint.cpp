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

bool MarchCheckpoint::describe(Checkpoint& checkpoint, const MarchProgress& progress) const
{
  const std::vector<double> own = marks_of(structure_, plan_);
  std::vector<double> marks = own;
  squeal::describe(checkpoint, marks);
  if (!agree(marks, own)) return false;
  MarchSummary& summary = progress.summary;
  describe_all(checkpoint, summary.steps, summary.unconverged, summary.as_one, summary.first_unconverged,
               summary.contact_residual_max, summary.fall_of_friction_max, summary.energy_defect_max,
               progress.iterations, slides_, amplitude_.time, amplitude_.log_modulus, progress.history);
  describe_state(checkpoint, FileOrder(structure_), progress.state);
  return true;
}

void MarchCheckpoint::keep(const MarchProgress& progress) const
{
  if (checkpoints_are_kept())
  {
    Checkpoint checkpoint;
    describe(checkpoint, progress);
    if (rank_of(comm_of(structure_.load)) == 0) squeal::keep(checkpoint, name_of_file);
  }
  checkpoint_made();
}

void MarchCheckpoint::restore(const MarchProgress& progress) const
{
  const MPI_Comm comm = comm_of(structure_.load);
  std::optional<Checkpoint> checkpoint = kept_everywhere(name_of_file, comm);
  if (checkpoint && describe(*checkpoint, progress) && rank_of(comm) == 0)
    std::printf("  goes on from the checkpoint after %ld of %ld steps\n", progress.summary.steps, plan_.steps);
}

} // namespace squeal
