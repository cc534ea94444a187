#include "squeal/study/sweep.hpp"

#include "squeal/base/run_control.hpp"
#include "sweep_groups.hpp"
#include "sweep_motions.hpp"
#include "sweeper.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

/// Where a point is, for messages.
std::string place_of(const SweepPoint& point, const std::vector<std::string>& keys)
{
  std::string text;
  for (std::size_t k = 0; k < keys.size(); ++k)
    text += (k == 0 ? "" : ", ") + format("%s = %g", keys[k].c_str(), point.values[k]);
  return text + (point.reversed ? ", rotation reversed" : "");
}

/// Sets what follows from the points.
void assess(Sweep& sweep, const std::vector<std::string>& keys, std::size_t total)
{
  Outcome& outcome = sweep.outcome;
  outcome.iterations = static_cast<int>(sweep.points.size());
  const bool complete = outcome.kind != OutcomeKind::interrupted;
  const auto motions =
      std::ranges::count_if(sweep.points, [](const SweepPoint& point) { return point.motion.has_value(); });
  if (!complete)
    outcome.reason = format("the run was ended %s after %td of %zu points", who_asked_to_end().c_str(),
                            std::ranges::count(sweep.points, false, &SweepPoint::inserted), total) +
                     (motions > 0 ? format(" and %td motions", motions) : "");
  const auto note = [&](const auto& outcome_of, const std::string& what, bool fails)
  {
    int failed = 0;
    std::string first;
    for (const SweepPoint& point : sweep.points)
      if (const Outcome* at = outcome_of(point); at && !succeeded(*at) && ++failed == 1)
        first = place_of(point, keys) + ": " + at->reason;
    if (failed == 0) return;
    if (complete && fails) outcome.kind = OutcomeKind::not_converged;
    outcome.reason +=
        (outcome.reason.empty() ? "" : "; ") + format("%d %s failed, the first at ", failed, what.c_str()) + first;
  };
  const auto at_point = [](bool inserted)
  { return [=](const SweepPoint& point) { return point.inserted == inserted ? &point.outcome : nullptr; }; };
  note(at_point(false), format("of %zu points", total), true);
  note([](const SweepPoint& point) { return point.motion ? &point.motion->outcome : nullptr; },
       format("of %td motions", motions), true);
  const auto inserted = std::ranges::count(sweep.points, true, &SweepPoint::inserted);
  note(at_point(true), format("of %td points put in between", inserted), false); // modes are followed without it
}

/// Each group's share of the points, visited at the same time. What a group throws ends all of them after their work.
Sweep run_in_groups(const SweepProblem& problem, const std::vector<SweepLine>& lines, int groups, MPI_Comm comm)
{
  const RankGroup group(comm, groups);
  std::vector<std::vector<SweepLine>> shares;
  for (int g = 0; g < groups; ++g) shares.push_back(share_of(lines, g, groups));
  Sweep own;
  const auto visit_share = [&]
  { own = visit(problem, group.comm(), shares[static_cast<std::size_t>(group.number())]); };
  if (!work_in_parts(group, comm, visit_share)) own.outcome.kind = OutcomeKind::interrupted;
  Sweep whole = joined(shared(own, group, groups, comm), shares);
  whole.outcome.kind = own.outcome.kind; // the same on all ranks
  return whole;
}

} // namespace

Sweep run_sweep(const SweepProblem& problem, MPI_Comm comm)
{
  constexpr std::size_t fewest = 4; // points of a group: two that another one visits as well cost half as much again
  const std::vector<SweepLine> lines = lines_of(problem.settings);
  const std::size_t total = points_of(lines);
  const int groups = groups_of(problem.options.groups, {total, fewest}, comm);
  const auto linear = [&]
  { return groups > 1 ? run_in_groups(problem, lines, groups, comm) : visit(problem, comm, lines); };
  Sweep sweep = problem.settings.stages == SweepStages::cycle ? with_motions(linear, problem, comm) : linear();
  assess(sweep, problem.settings.key, total);
  return sweep;
}

} // namespace squeal
