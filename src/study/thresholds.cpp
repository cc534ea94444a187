#include "thresholds.hpp"

#include "squeal/algebra/root.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>

namespace squeal
{

namespace
{

using PointNumbers = std::vector<std::size_t>;

/// Points of one step, at most. Three thresholds of up to 4 log2(1e5) points each (algebra/root.hpp) are fewer.
constexpr int most_points = 200;

double instability(const Followed& point, std::size_t place)
{
  return instability_of(point.modes.pairs[place].lambda);
}

/// The unstable modes among these come first, by falling growth.
PointNumbers by_growth(const Followed& point, PointNumbers places)
{
  std::ranges::stable_sort(places,
                           [&](std::size_t a, std::size_t b) { return instability(point, a) > instability(point, b); });
  return places;
}

std::size_t unstable_among(const Followed& point, const PointNumbers& places)
{
  return static_cast<std::size_t>(
      std::ranges::count_if(places, [&](std::size_t place) { return instability(point, place) > 0; }));
}

/// A cluster of modes that two points match with each other; or the modes of the band that have no match.
struct Group
{
  PointNumbers from, to; // matched ones stand at the same place of both
  bool matched = true;
};

std::vector<Group> groups_between(const Followed& a, const Followed& b, const std::vector<Match>& matches, double band)
{
  std::map<int, Group> clusters;
  Group others{{}, {}, false};
  std::vector<char> taken(b.modes.pairs.size(), 0);
  for (std::size_t i = 0; i < matches.size(); ++i)
  {
    if (matches[i].to < 0)
    {
      if (in_band(a.modes.pairs[i], band)) others.from.push_back(i);
      continue;
    }
    const auto to = static_cast<std::size_t>(matches[i].to);
    Group& group = clusters[matches[i].cluster];
    group.from.push_back(i);
    group.to.push_back(to);
    taken[to] = 1;
  }
  for (std::size_t j = 0; j < taken.size(); ++j)
    if (!taken[j] && in_band(b.modes.pairs[j], band)) others.to.push_back(j);
  std::vector<Group> groups;
  for (auto& [first, group] : clusters)
    if (std::ranges::any_of(group.from, [&](std::size_t i) { return in_band(a.modes.pairs[i], band); }) ||
        std::ranges::any_of(group.to, [&](std::size_t j) { return in_band(b.modes.pairs[j], band); }))
      groups.push_back(std::move(group));
  groups.push_back(std::move(others));
  return groups;
}

/// Whether a mode of the group becomes unstable or stable, as far as its modes can be distinguished.
bool changes(const Followed& a, const Followed& b, const Group& group)
{
  if (!group.matched) return unstable_among(a, group.from) != unstable_among(b, group.to);
  for (std::size_t k = 0; k < group.from.size(); ++k)
    if ((instability(a, group.from[k]) > 0) != (instability(b, group.to[k]) > 0)) return true;
  return false;
}

/// Where modes go that are matched among themselves alone; nothing: they mix with others, or are lost.
std::optional<PointNumbers> images(const PointNumbers& places, const std::vector<Match>& matches)
{
  PointNumbers to;
  for (const std::size_t i : places)
  {
    if (matches[i].to < 0) return std::nullopt;
    to.push_back(static_cast<std::size_t>(matches[i].to));
  }
  for (std::size_t k = 0; k < matches.size(); ++k)
    for (const std::size_t i : places)
      if (matches[k].to >= 0 && matches[k].cluster == matches[i].cluster &&
          std::ranges::find(places, k) == places.end())
        return std::nullopt;
  return to;
}

class Finder
{
public:
  explicit Finder(const ThresholdSearch& search) : search_(search) {}

  /// Refines the step until nothing changes in its parts, or they are short enough.
  void look_between(const Followed& a, Followed& b, const std::vector<Match>& matches)
  {
    const std::vector<Group> groups = groups_between(a, b, matches, search_.band);
    const auto changing = std::ranges::find_if(groups, [&](const Group& group) { return changes(a, b, group); });
    if (changing != groups.end() && std::abs(b.values[0] - a.values[0]) > search_.tolerance)
    {
      std::vector<Followed> points = points_between(a, b, *changing);
      if (!points.empty())
      {
        const std::size_t known = found_.size();
        const Followed* last = &a;
        for (Followed& point : points)
        {
          look_between(*last, point, search_.follow(*last, point));
          last = &point;
        }
        look_between(*last, b, search_.follow(*last, b));
        // a mode that changes beyond the band changes in none of the parts: the whole of them holds its threshold
        if (found_.size() == known && !ended_) record(a, b, *changing);
        return;
      }
    }
    b.tracks.assign(b.modes.pairs.size(), -1);
    for (std::size_t i = 0; i < matches.size(); ++i)
      if (matches[i].to >= 0) b.tracks[static_cast<std::size_t>(matches[i].to)] = a.tracks[i];
    for (const Group& group : groups) record(a, b, group);
  }

  std::vector<Threshold> found() { return std::move(found_); }

private:
  /// A point with the modes of a group there.
  struct Known
  {
    const Followed* point;
    PointNumbers places;
  };

  std::optional<Followed> point_at(double value)
  {
    if (ended_ || points_++ == most_points) ended_ = true;
    if (ended_) return std::nullopt;
    std::optional<Followed> point = search_.point_at(value);
    ended_ = !point;
    return point;
  }

  /// Points that enclose a threshold of the group to the tolerance, or halve the step, in the order of the way.
  std::vector<Followed> points_between(const Followed& a, const Followed& b, const Group& group)
  {
    std::deque<Followed> points; // which stay where they are
    if (!enclose(a, b, group, points) && !ended_)
      if (std::optional<Followed> middle = point_at((a.values[0] + b.values[0]) / 2))
        points.push_back(std::move(*middle));
    const bool rising = b.values[0] > a.values[0];
    std::ranges::sort(points, [&](const Followed& x, const Followed& y)
                      { return rising ? x.values[0] < y.values[0] : x.values[0] > y.values[0]; });
    return {std::make_move_iterator(points.begin()), std::make_move_iterator(points.end())};
  }

  /// Of the modes of a group the growth rates are sorted: they are continuous whether or not the modes can be
  /// distinguished, and the first one past the smaller number of unstable modes changes its sign. False: the numbers
  /// are equal, or the group mixes with others on the way.
  bool enclose(const Followed& a, const Followed& b, const Group& group, std::deque<Followed>& points)
  {
    const std::size_t before = unstable_among(a, group.from), after = unstable_among(b, group.to);
    if (!group.matched || before == after) return false;
    const std::size_t rank = std::min(before, after);
    const auto ranked = [&](const Followed& point, const PointNumbers& places)
    { return instability(point, by_growth(point, places)[rank]); };
    std::vector<Known> known = {{&a, group.from}, {&b, group.to}};
    bool clear = true;
    const auto growth = [&](double value) -> std::optional<double>
    {
      std::optional<Followed> here = point_at(value);
      if (!here) return std::nullopt;
      const Known& nearest = *std::ranges::min_element(
          known, {}, [&](const Known& one) { return std::abs(one.point->values[0] - value); });
      const std::optional<PointNumbers> places = images(nearest.places, search_.follow(*nearest.point, *here));
      points.push_back(std::move(*here));
      clear = places.has_value();
      if (!clear) return std::nullopt;
      known.push_back({&points.back(), *places});
      return ranked(points.back(), *places);
    };
    find_root(growth, {a.values[0], b.values[0], ranked(a, group.from), ranked(b, group.to)}, search_.tolerance);
    return clear && !points.empty();
  }

  /// What a step that is not divided any further holds: as many thresholds as the group's unstable modes become more or
  /// fewer. Modes that only seem to change places are none.
  void record(const Followed& a, Followed& b, const Group& group)
  {
    const PointNumbers from = by_growth(a, group.from), to = by_growth(b, group.to);
    const std::size_t before = unstable_among(a, from), after = unstable_among(b, to);
    const bool gained = after > before;
    std::vector<int> tracks = tracks_that_change(a, b, group, gained);
    for (std::size_t rank = std::min(before, after); rank < std::max(before, after); ++rank)
    {
      const double low = a.values[0], high = b.values[0];
      Threshold threshold{b.values, b.reversed, tracks[rank - std::min(before, after)],
                          std::max(std::abs(high - low), search_.tolerance)}; // rounding has its part in shorter ones
      const std::complex<double> lambda = gained ? b.modes.pairs[to[rank]].lambda : a.modes.pairs[from[rank]].lambda;
      threshold.values[0] = (low + high) / 2;
      if (group.matched)
      {
        const double at_low = instability(a, from[rank]), at_high = instability(b, to[rank]);
        threshold.values[0] = (low * at_high - high * at_low) / (at_high - at_low);
      }
      threshold.frequency_hz = frequency_hz_of(lambda);
      threshold.change = gained == (high > low) ? 1 : -1;
      found_.push_back(std::move(threshold));
    }
  }

  /// Tracks of the modes that become unstable, or stable. Those that are lost or new get a number.
  std::vector<int> tracks_that_change(const Followed& a, Followed& b, const Group& group, bool gained) const
  {
    std::vector<int> tracks;
    const auto named = [&](int track) { return track < 0 ? search_.tracks++ : track; };
    if (group.matched)
    {
      for (std::size_t k = 0; k < group.from.size(); ++k)
        if (gained ? instability(a, group.from[k]) <= 0 && instability(b, group.to[k]) > 0
                   : instability(a, group.from[k]) > 0 && instability(b, group.to[k]) <= 0)
          tracks.push_back(b.tracks[group.to[k]] = named(b.tracks[group.to[k]]));
    }
    else if (gained)
    {
      for (const std::size_t j : group.to)
        if (instability(b, j) > 0) tracks.push_back(b.tracks[j] = named(b.tracks[j]));
    }
    else
      for (const std::size_t i : group.from)
        if (instability(a, i) > 0) tracks.push_back(named(a.tracks[i]));
    return tracks;
  }

  const ThresholdSearch& search_;
  int points_ = 0;
  bool ended_ = false;
  std::vector<Threshold> found_{};
};

} // namespace

std::vector<Threshold> find_thresholds(const ThresholdSearch& search, const Followed& before, Followed& now,
                                       const std::vector<Match>& matches)
{
  Finder finder(search);
  finder.look_between(before, now, matches);
  return finder.found();
}

} // namespace squeal
