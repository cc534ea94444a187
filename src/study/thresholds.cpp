#include "point_modes.hpp"

#include "squeal/algebra/root.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

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

class Finder
{
public:
  explicit Finder(const ThresholdSearch& search) : search_(search) {}

  /// Refines the step until nothing changes in its parts, or they are short enough.
  void look_between(const Followed& a, Followed& b, const std::vector<Match>& matches)
  {
    Changes changes = changes_between(a, b, matches);
    if ((!changes.gained.empty() || !changes.lost.empty()) && std::abs(b.values[0] - a.values[0]) > search_.tolerance &&
        !ended_)
    {
      std::vector<Followed> points = points_between(a, b);
      const std::size_t known = found_.size();
      const Followed* last = &a;
      for (Followed& point : points)
      {
        look_between(*last, point, search_.follow(*last, point));
        last = &point;
      }
      if (!points.empty())
      {
        look_between(*last, b, search_.follow(*last, b));
        // a mode that enters the band unstable changes in none of the parts: the whole of them holds its threshold
        if (found_.size() == known && !ended_) record(a, b, changes);
        return;
      }
    }
    b.tracks.assign(b.modes.pairs.size(), -1);
    for (std::size_t i = 0; i < matches.size(); ++i)
      if (matches[i].to >= 0) b.tracks[static_cast<std::size_t>(matches[i].to)] = a.tracks[i];
    record(a, b, changes);
  }

  std::vector<Threshold> found() { return std::move(found_); }

private:
  /// The modes of the band that become unstable, of the later point, and those that become stable, of the earlier one;
  /// falling growth.
  struct Changes
  {
    PointNumbers gained{}, lost{};
  };

  /// The modes of the band, falling growth.
  PointNumbers by_growth(const Followed& point) const
  {
    PointNumbers places;
    for (std::size_t k = 0; k < point.modes.pairs.size(); ++k)
      if (in_band(point.modes.pairs[k], search_.band)) places.push_back(k);
    std::ranges::stable_sort(places, std::greater{}, [&](std::size_t place) { return instability(point, place); });
    return places;
  }

  PointNumbers unstable(const Followed& point) const
  {
    PointNumbers places = by_growth(point);
    std::erase_if(places, [&](std::size_t place) { return instability(point, place) <= 0; });
    return places;
  }

  Changes changes_between(const Followed& a, const Followed& b, const std::vector<Match>& matches) const
  {
    std::vector<int> back(b.modes.pairs.size(), -1);
    for (std::size_t i = 0; i < matches.size(); ++i)
      if (matches[i].to >= 0) back[static_cast<std::size_t>(matches[i].to)] = static_cast<int>(i);
    Changes changes{unstable(b), unstable(a)};
    const auto stays = [](const Followed& other, int place)
    { return place >= 0 && instability(other, static_cast<std::size_t>(place)) > 0; };
    std::erase_if(changes.gained, [&](std::size_t j) { return stays(a, back[j]); });
    std::erase_if(changes.lost, [&](std::size_t i) { return stays(b, matches[i].to); });
    return changes;
  }

  std::optional<Followed> point_at(double value)
  {
    if (ended_ || points_++ == most_points) ended_ = true;
    if (ended_) return std::nullopt;
    std::optional<Followed> point = search_.point_at(value);
    ended_ = !point;
    return point;
  }

  /// Points that enclose a threshold to the tolerance, in the order of the way, or the middle between equal numbers of
  /// unstable modes. In falling order the growth rates of the band are continuous, whether or not modes can be
  /// distinguished. The first one past the smaller number changes its sign.
  std::vector<Followed> points_between(const Followed& a, const Followed& b)
  {
    const std::size_t before = unstable(a).size(), after = unstable(b).size(), rank = std::min(before, after);
    const auto ranked = [&](const Followed& point)
    {
      const PointNumbers places = by_growth(point);
      return rank < places.size() ? instability(point, places[rank]) : -1.;
    };
    std::vector<Followed> points;
    const auto growth = [&](double value) -> std::optional<double>
    {
      std::optional<Followed> here = point_at(value);
      if (here) points.push_back(std::move(*here));
      return here ? std::optional(ranked(points.back())) : std::nullopt;
    };
    if (before == after)
      growth((a.values[0] + b.values[0]) / 2);
    else
      find_root(growth, {a.values[0], b.values[0], ranked(a), ranked(b)}, search_.tolerance);
    std::ranges::sort(points, {}, [](const Followed& point) { return point.values[0]; });
    if (b.values[0] < a.values[0]) std::ranges::reverse(points);
    return points;
  }

  /// Records the thresholds of a step that is not divided any further. They are as many as there are more or fewer
  /// unstable modes, of the least growth. Modes that only seem to change places are none. A track that is lost or new
  /// gets a number.
  void record(const Followed& a, Followed& b, Changes& changes)
  {
    const bool gains = changes.gained.size() > changes.lost.size();
    const std::size_t of_other = std::min(changes.gained.size(), changes.lost.size());
    PointNumbers& changed = gains ? changes.gained : changes.lost;
    changed.erase(changed.begin(), changed.begin() + static_cast<std::ptrdiff_t>(of_other));
    const double low = a.values[0], high = b.values[0];
    for (const std::size_t place : changed)
    {
      const int track = (gains ? b : a).tracks[place], name = track < 0 ? search_.tracks++ : track;
      if (gains) b.tracks[place] = name;
      Threshold threshold{b, name,
                          std::max(std::abs(high - low), search_.tolerance)}; // rounding has its part in shorter ones
      threshold.values[0] = (low + high) / 2;
      threshold.frequency_hz = frequency_hz_of((gains ? b : a).modes.pairs[place].lambda);
      threshold.change = gains == (high > low) ? 1 : -1;
      found_.push_back(std::move(threshold));
    }
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
