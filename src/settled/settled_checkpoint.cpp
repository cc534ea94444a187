#include "settled_checkpoint.hpp"

#include "squeal/base/run_control.hpp"
#include "squeal/transient/step_checkpoint.hpp"

namespace squeal
{

namespace
{

constexpr const char* name_of_file = "settled";

MPI_Comm comm_of_motion(const SettledProgress& progress)
{
  return comm_of(progress.map.sliding.structure.load);
}

void describe_shapes(Checkpoint& checkpoint, const FileOrder& order, const Structure& structure, MotionShapes& shapes)
{
  std::size_t count = shapes.coordinates.size();
  checkpoint.pass_size(count);
  if (checkpoint.reads()) shapes = no_shapes(structure.M);
  const Owned<Vec> shape = zeros_like(structure.load);
  for (std::size_t i = 0; i < count; ++i)
  {
    if (!checkpoint.reads()) copy_column(shapes.V, static_cast<Eigen::Index>(i), shape);
    order.describe(checkpoint, shape);
    if (checkpoint.reads()) append(shapes.V, shape);
  }
  describe_all(checkpoint, shapes.coordinates, shapes.squares, shapes.largest);
}

/// Writes or reads the motion; false: the checkpoint is of another one.
bool describe_settled(Checkpoint& checkpoint, const SettledProgress& progress)
{
  const auto& [map, motion, now] = progress;
  const Structure& structure = map.sliding.structure;
  int steps = motion.steps_per_period;
  double period = motion.period;
  describe_all(checkpoint, steps, period);
  const bool same_period = std::abs(period - motion.period) <= 1e-9 * motion.period; // to the rounding of other ranks
  if (steps != motion.steps_per_period || !same_period) return false;
  describe_reactions(checkpoint, comm_of_motion(progress), map.reactions);
  describe_all(checkpoint, map.unconverged, motion.spectrum_probe, motion.history, now.motion.channels,
               now.motion.coordinate, now.motion.beside, now.bundle.growth);
  const FileOrder order(structure);
  const auto describe_both = [&](Vec x)
  {
    order.describe(checkpoint, displacement(x));
    order.describe(checkpoint, velocity(x));
  };
  describe_both(now.state);
  for (const Owned<Vec>& column : now.bundle.columns) describe_both(column);
  describe_shapes(checkpoint, order, structure, motion.shapes);
  return true;
}

} // namespace

void keep_settled(const SettledProgress& progress)
{
  checkpoint_made();
  if (!checkpoints_are_kept() || progress.now.motion.periods() == 0) return;
  Checkpoint checkpoint;
  describe_settled(checkpoint, progress);
  if (rank_of(comm_of_motion(progress)) == 0) keep(checkpoint, name_of_file);
}

void restore_settled(const SettledProgress& progress)
{
  const MPI_Comm comm = comm_of_motion(progress);
  std::optional<Checkpoint> checkpoint = kept_everywhere(name_of_file, comm);
  if (checkpoint && describe_settled(*checkpoint, progress) && rank_of(comm) == 0)
    std::printf("  goes on from the checkpoint after %zu periods\n", progress.now.motion.periods());
}

} // namespace squeal
