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

/// Visits the motion's vectors by their names.
template <class Visit> void for_each_vector(const SettledProgress& progress, Visit visit)
{
  const auto both = [&](const std::string& name, Vec x)
  {
    visit(name + " u", displacement(x));
    visit(name + " v", velocity(x));
  };
  both("state", progress.now.state);
  for (std::size_t i = 0; i < progress.now.bundle.columns.size(); ++i)
    both("column " + std::to_string(i), progress.now.bundle.columns[i]);
}

std::string channel_name(std::size_t i)
{
  return "channel " + std::to_string(i);
}

std::string growth_name(std::size_t i)
{
  return "growth " + std::to_string(i);
}

std::string coordinate_name(std::size_t i)
{
  return "coordinate " + std::to_string(i);
}

std::string shape_name(std::size_t i)
{
  return "shape " + std::to_string(i);
}

void put_shapes(const MotionShapes& shapes, const FileOrder& order, Vec like, Checkpoint& checkpoint)
{
  const Owned<Vec> shape = zeros_like(like);
  for (std::size_t i = 0; i < shapes.coordinates.size(); ++i)
  {
    copy_column(shapes.V, static_cast<Eigen::Index>(i), shape);
    checkpoint.set(shape_name(i), order.gather(shape));
    checkpoint.set(coordinate_name(i), shapes.coordinates[i]);
  }
  checkpoint.set("squares", shapes.squares);
  checkpoint.set("largest square", shapes.largest);
}

void take_shapes(const Checkpoint& checkpoint, const FileOrder& order, Mat M, Vec like, MotionShapes& shapes)
{
  const Owned<Vec> shape = zeros_like(like);
  shapes = no_shapes(M);
  for (std::size_t i = 0; checkpoint.has(shape_name(i)); ++i)
  {
    order.scatter(checkpoint.list(shape_name(i)), shape);
    append(shapes.V, shape);
    shapes.coordinates.push_back(checkpoint.list(coordinate_name(i)));
  }
  shapes.squares = checkpoint.list("squares");
  shapes.largest = checkpoint.number("largest square");
}

bool is_of_this_motion(const Checkpoint& checkpoint, const SettledMotion& motion)
{
  const double period = checkpoint.number("period");
  return static_cast<int>(checkpoint.number("steps")) == motion.steps_per_period &&
         std::abs(period - motion.period) <= 1e-9 * motion.period; // to the rounding of another number of ranks
}

} // namespace

void keep_settled(const SettledProgress& progress)
{
  const auto& [map, motion, now] = progress;
  checkpoint_made();
  if (!checkpoints_are_kept() || now.motion.periods() == 0) return;
  Checkpoint checkpoint;
  const FileOrder order(map.sliding.structure);
  for_each_vector(progress, [&](const std::string& name, Vec x) { checkpoint.set(name, order.gather(x)); });
  put_ranks(comm_of_motion(progress), checkpoint);
  checkpoint.set("period", motion.period);
  checkpoint.set("steps", motion.steps_per_period);
  checkpoint.set("reactions", map.reactions);
  checkpoint.set("unconverged", static_cast<double>(map.unconverged));
  checkpoint.set("spectrum probe", motion.spectrum_probe);
  put_history(motion.history, checkpoint);
  put_shapes(motion.shapes, order, map.sliding.structure.load, checkpoint);
  for (std::size_t i = 0; i < now.motion.channels.size(); ++i) checkpoint.set(channel_name(i), now.motion.channels[i]);
  for (std::size_t i = 0; i < now.bundle.growth.size(); ++i) checkpoint.set(growth_name(i), now.bundle.growth[i]);
  checkpoint.set("coordinate", now.motion.coordinate);
  checkpoint.set("beside", now.motion.beside);
  if (rank_of(comm_of_motion(progress)) == 0) keep(checkpoint, name_of_file);
}

void restore_settled(const SettledProgress& progress)
{
  const auto& [map, motion, now] = progress;
  const MPI_Comm comm = comm_of_motion(progress);
  const auto checkpoint = kept_everywhere(name_of_file, comm);
  if (!checkpoint || !is_of_this_motion(*checkpoint, motion)) return;
  const FileOrder order(map.sliding.structure);
  for_each_vector(progress, [&](const std::string& name, Vec x) { order.scatter(checkpoint->list(name), x); });
  if (of_these_ranks(*checkpoint, comm)) map.reactions = checkpoint->list("reactions"); // else pairs have other numbers
  map.unconverged = static_cast<long>(checkpoint->number("unconverged"));
  motion.spectrum_probe = static_cast<int>(checkpoint->number("spectrum probe"));
  take_history(*checkpoint, motion.history);
  const Structure& structure = map.sliding.structure;
  take_shapes(*checkpoint, order, structure.M, structure.load, motion.shapes);
  now.motion.channels.clear();
  for (std::size_t i = 0; checkpoint->has(channel_name(i)); ++i)
    now.motion.channels.push_back(checkpoint->list(channel_name(i)));
  for (std::size_t i = 0; i < now.bundle.growth.size(); ++i) now.bundle.growth[i] = checkpoint->list(growth_name(i));
  now.motion.coordinate = checkpoint->list("coordinate");
  now.motion.beside = checkpoint->list("beside");
  if (rank_of(comm) == 0) std::printf("  goes on from the checkpoint after %zu periods\n", now.motion.periods());
}

} // namespace squeal
