#include "sweep_groups.hpp"

#include "following.hpp"
#include "squeal/base/free_memory.hpp"
#include "squeal/base/run_control.hpp"
#include "sweep_checkpoint.hpp"

#include <algorithm>
#include <exception>
#include <map>

namespace squeal
{

namespace
{

using TrackNames = std::map<int, int>; // of a part, to those of the whole

/// The names of a point's tracks by those of the same point elsewhere, matched by their eigenvalues.
TrackNames names_by(const SweepPoint& here, const SweepPoint& there)
{
  std::vector<std::complex<double>> own, known;
  for (const SweptMode& mode : here.modes) own.push_back(mode.lambda);
  for (const SweptMode& mode : there.modes) known.push_back(mode.lambda);
  TrackNames names;
  const std::vector<int> partners = nearest_partners(own, known);
  for (std::size_t i = 0; i < partners.size(); ++i)
    if (partners[i] >= 0) names[here.modes[i].track] = there.modes[static_cast<std::size_t>(partners[i])].track;
  return names;
}

bool at_one_place(const SweepPoint& a, const SweepPoint& b)
{
  return a.values == b.values && a.reversed == b.reversed;
}

/// The last of the points that is this one and has modes; null: there is none.
const SweepPoint* same_point(const std::vector<SweepPoint>& points, const SweepPoint& wanted)
{
  const auto found = std::find_if(points.rbegin(), points.rend(),
                                  [&](const SweepPoint& point) {
                                    return at_one_place(point, wanted) && point.outcome.kind == OutcomeKind::converged;
                                  });
  return found == points.rend() ? nullptr : &*found;
}

bool of_line(const Threshold& threshold, const SweepLine& line)
{
  const std::vector<double>& values = line.points.front();
  return threshold.reversed == line.reversed &&
         std::equal(values.begin() + 1, values.end(), threshold.values.begin() + 1, threshold.values.end());
}

/// Gives parts their places in the whole.
class Joiner
{
public:
  explicit Joiner(const Sweep& first) : whole_(first) {}

  void add(const Sweep& part, const std::vector<SweepLine>& share)
  {
    std::array<TrackNames, 2> of_starts; // of lines, in either direction of rotation
    const auto has = [&](const SweepPoint& wanted) {
      return std::ranges::any_of(whole_.points, [&](const SweepPoint& point) { return at_one_place(point, wanted); });
    };
    auto point = part.points.begin();
    for (const SweepLine& line : share)
    {
      const auto begin = point;
      for (std::size_t visited = 0; point != part.points.end() && visited < line.points.size(); ++point)
        visited += point->inserted ? 0 : 1;
      TrackNames known;
      if (line.known && begin != point)
        if (const SweepPoint* const there = same_point(whole_.points, *begin)) known = names_by(*begin, *there);
      TrackNames& of_start = of_starts[line.reversed];
      if (line.known && line.points.size() == 1)
        of_start = known;
      else if (line.known && begin != point && has(*begin)) // it lacks where a group was asked to end
        take(part, line, {begin + 1, point}, known);
      else
      {
        if (of_start.empty()) of_start = of_starts[!line.reversed];
        take(part, line, {begin, point}, of_start);
      }
    }
    whole_.lost += part.lost;
    whole_.cut_short += part.cut_short;
    whole_.least_mac = std::min(whole_.least_mac, part.least_mac);
    whole_.least_mac_across = std::min(whole_.least_mac_across, part.least_mac_across);
    whole_.outcome.residual = std::max(whole_.outcome.residual, part.outcome.residual);
    whole_.basis = std::max(whole_.basis, part.basis);
    whole_.passes += part.passes;
  }

  Sweep whole() { return std::move(whole_); }

private:
  /// The points and thresholds of a line; what has no name yet gets a new one.
  void take(const Sweep& part, const SweepLine& line, std::vector<SweepPoint> points, TrackNames& names)
  {
    const auto rename = [&](int& track)
    {
      if (track < 0) return;
      const auto [name, is_new] = names.try_emplace(track, whole_.tracks);
      whole_.tracks += is_new;
      track = name->second;
    };
    for (SweepPoint& point : points)
    {
      for (SweptMode& mode : point.modes) rename(mode.track);
      whole_.points.push_back(std::move(point));
    }
    for (Threshold threshold : part.thresholds)
      if (of_line(threshold, line))
      {
        rename(threshold.track);
        whole_.thresholds.push_back(std::move(threshold));
      }
  }

  Sweep whole_;
};

} // namespace

int first_rank(int group, int groups, int ranks)
{
  return static_cast<int>((static_cast<long>(group) * ranks + groups - 1) / groups);
}

int groups_of(PetscInt wanted, const SharedPoints& shared, MPI_Comm comm)
{
  const auto [points, fewest] = shared;
  const int ranks = ranks_of(comm);
  if (wanted > 0) return std::min({static_cast<int>(wanted), ranks, static_cast<int>(points)});
  const double of_model = peak_memory(comm), free = free_memory(comm); // a model with its modes, as so far
  int groups = static_cast<int>(std::min<std::size_t>(static_cast<std::size_t>(ranks), points / fewest));
  groups = std::min(groups, 1 + static_cast<int>(free / of_model));
  while (groups > 1 && ranks % groups != 0) --groups;
  MPI_Bcast(&groups, 1, MPI_INT, 0, comm);
  return std::max(1, groups);
}

RankGroup::RankGroup(MPI_Comm comm, int groups)
{
  const int rank = rank_of(comm), ranks = ranks_of(comm);
  while (first_rank(number_ + 1, groups, ranks) <= rank) ++number_;
  MPI_Comm_split(comm, number_, rank, &comm_);
}

bool work_in_parts(const RankGroup& group, MPI_Comm comm, const std::function<void()>& work)
{
  std::exception_ptr failure;
  try
  {
    const Finally part = work_of_part(group.comm());
    work();
  }
  catch (const Interrupted&) // which join_parts throws on all ranks
  {
  }
  catch (...)
  {
    failure = std::current_exception();
  }
  agree(comm, failure);
  try
  {
    join_parts(comm);
  }
  catch (const Interrupted&) // of groups that were done, too
  {
    return false;
  }
  return true;
}

std::vector<Sweep> shared(const Sweep& own, const RankGroup& group, int groups, MPI_Comm comm)
{
  std::vector<Sweep> parts;
  for (int g = 0; g < groups; ++g)
    parts.push_back(of_rank(first_rank(g, groups, ranks_of(comm)), g == group.number() ? own : Sweep{}, comm));
  return parts;
}

Sweep joined(const std::vector<Sweep>& parts, const std::vector<std::vector<SweepLine>>& shares)
{
  Joiner joiner(parts.front());
  for (std::size_t g = 1; g < parts.size(); ++g) joiner.add(parts[g], shares[g]);
  Sweep whole = joiner.whole();
  whole.groups = static_cast<int>(parts.size());
  return whole;
}

} // namespace squeal
