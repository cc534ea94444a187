#include "sweep_motions.hpp"

#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"
#include "sweep_checkpoint.hpp"
#include "sweep_groups.hpp"

namespace squeal
{

namespace
{

/// Points of the scene where a mode grows.
std::vector<std::size_t> places_of_motions(const Sweep& sweep)
{
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < sweep.points.size(); ++i)
    if (const SweepPoint& point = sweep.points[i]; !point.inserted && point.unstable > 0) places.push_back(i);
  return places;
}

/// The motion at a point. What cannot be computed there is in its outcome.
SweptMotion motion_at(const SweepProblem& problem, const SweptPlace& place, MPI_Comm comm)
{
  const Finally of_stages = without_checkpoints();
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
    SweptMotion motion;
    const Description described = [&](Checkpoint& checkpoint) { describe(checkpoint, motion); };
    if (!restore(name, comm, described))
    {
      end_if_asked(comm);
      motion = motion_at(problem, {point.values, point.reversed}, comm);
      keep(name, comm, described);
    }
    point.motion = motion;
    progress.update(++done, motion.heard);
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
  const auto seek_share = [&] { seek_motions(sweep, share_of(places, group.number(), groups), problem, group.comm()); };
  const bool ended = !work_in_parts(group, comm, seek_share);
  for (int g = 0; g < groups; ++g)
    for (const std::size_t place : share_of(places, g, groups))
    {
      std::optional<SweptMotion>& motion = sweep.points[place].motion;
      const int from = first_rank(g, groups, ranks_of(comm));
      int is_known = motion.has_value();
      MPI_Bcast(&is_known, 1, MPI_INT, from, comm);
      if (is_known != 0) motion = of_rank(from, motion.value_or(SweptMotion{}), comm);
    }
  if (ended) throw Interrupted{};
}

} // namespace

Sweep with_motions(const std::function<Sweep()>& linear, const SweepProblem& problem, MPI_Comm comm)
{
  Sweep sweep = linear();
  if (sweep.outcome.kind == OutcomeKind::interrupted) return sweep;
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
