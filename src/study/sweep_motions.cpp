#include "sweep_motions.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"
#include "sweep_checkpoint.hpp"
#include "sweep_groups.hpp"

namespace squeal
{

namespace
{

/// Of the modes of all points, once they are done.
constexpr const char* name_of_modes = "sweep_modes";

/// Points of the scene where a mode grows.
std::vector<std::size_t> places_of_motions(const Sweep& sweep)
{
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < sweep.points.size(); ++i)
    if (const SweepPoint& point = sweep.points[i]; !point.inserted && point.unstable > 0) places.push_back(i);
  return places;
}

/// The motion at a point. What cannot be computed there is in its outcome. The stages at a point keep checkpoints of
/// their own, from which they go on.
SweptMotion motion_at(const SweepProblem& problem, const SweptPlace& place, const std::string& name, MPI_Comm comm)
{
  const CheckpointNames names(name + ".");
  SweptMotion motion;
  try
  {
    motion = problem.motion_at(place, comm);
  }
  catch (const LibraryError&)
  {
    throw;
  }
  catch (const Error& error)
  {
    motion.outcome = {OutcomeKind::not_converged, error.what(), 0, 0};
    motion.heard = std::string("nothing is known: ") + error.what();
  }
  return motion;
}

/// The motions of some of the places, each kept for a restart as soon as it is known. Interrupted: the run was asked to
/// end; those that are known stay.
void seek_motions(Sweep& sweep, const std::vector<std::size_t>& places, const SweepProblem& problem, MPI_Comm comm)
{
  Progress progress(comm, "motions", static_cast<double>(places.size()));
  for (double done = 0; const std::size_t place : places)
  {
    SweepPoint& point = sweep.points[place];
    const std::string name = format("sweep_motion_%06zu", place);
    if (const std::optional<Checkpoint> kept = kept_everywhere(name, comm))
      point.motion = value_of<SweptMotion>(*kept);
    else
    {
      end_if_asked(comm);
      point.motion = motion_at(problem, {point.values, point.reversed}, name, comm);
      if (checkpoints_are_kept() && rank_of(comm) == 0)
      {
        keep(written(*point.motion), name);
        const CheckpointNames names(name + ".");
        CheckpointNames::remove_all();
      }
    }
    progress.update(++done, point.motion->heard);
  }
}

/// The places of one group: in turn, since neighbouring points take about as long.
std::vector<std::size_t> share_of(const std::vector<std::size_t>& places, int group, int groups)
{
  std::vector<std::size_t> share;
  for (std::size_t i = static_cast<std::size_t>(group); i < places.size(); i += static_cast<std::size_t>(groups))
    share.push_back(places[i]);
  return share;
}

void seek_in_groups(Sweep& sweep, const std::vector<std::size_t>& places, const SweepProblem& problem, int groups,
                    MPI_Comm comm)
{
  const RankGroup group(comm, groups);
  bool ended = false;
  try
  {
    work_in_parts(comm,
                  [&]
                  {
                    const WorkOfPart part(group.comm());
                    seek_motions(sweep, share_of(places, group.number(), groups), problem, group.comm());
                  });
  }
  catch (const Interrupted&) // on all ranks
  {
    ended = true;
  }
  for (int g = 0; g < groups; ++g)
    for (const std::size_t place : share_of(places, g, groups))
    {
      std::optional<SweptMotion>& motion = sweep.points[place].motion;
      std::string bytes = g == group.number() && motion ? written(*motion).bytes() : std::string();
      broadcast(bytes, comm, first_rank(g, groups, ranks_of(comm)));
      if (!bytes.empty()) motion = value_of<SweptMotion>(*Checkpoint::from(bytes));
    }
  if (ended) throw Interrupted{};
}

} // namespace

Sweep with_motions(const std::function<Sweep()>& linear, const SweepProblem& problem, MPI_Comm comm)
{
  Sweep sweep = kept_sweep(name_of_modes, comm);
  if (sweep.points.empty())
  {
    sweep = linear();
    if (sweep.outcome.kind == OutcomeKind::interrupted) return sweep;
    keep_sweep(sweep, name_of_modes, comm);
  }
  const std::vector<std::size_t> places = places_of_motions(sweep);
  const int groups = groups_of(problem.options.groups, {places.size(), 1}, comm);
  try
  {
    if (groups > 1)
      seek_in_groups(sweep, places, problem, groups, comm);
    else
      seek_motions(sweep, places, problem, comm);
  }
  catch (const Interrupted&)
  {
    sweep.outcome.kind = OutcomeKind::interrupted;
  }
  return sweep;
}

} // namespace squeal
