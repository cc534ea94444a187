/// Results of sweeps and of random samples.
#include "result.hpp"
#include "squeal/scene/numbers.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

namespace squeal
{

namespace
{

/// A followed mode in one direction of rotation, where it grows most.
struct Track
{
  int number = 0;
  SweptPlace place;
  SweptMode mode{};
  int points = 0, unstable = 0; // where it was found, and where it is unstable
  double least_mac = 1;
  const SweepPoint* last = nullptr; // of these
};

/// Those that are unstable somewhere, by rising number.
std::vector<Track> unstable_tracks(const Sweep& sweep)
{
  std::map<std::pair<int, bool>, Track> tracks;
  for (const SweepPoint& point : sweep.points)
    for (const SweptMode& mode : point.modes)
    {
      if (mode.track < 0) continue;
      Track& track = tracks[{mode.track, point.reversed}];
      if (std::exchange(track.last, &point) == &point)
        continue; // design points have several of one name; the first grows most
      track.number = mode.track;
      track.unstable += is_unstable(mode.lambda);
      track.least_mac = std::min(track.least_mac, mode.mac);
      if (track.points++ > 0 && track.mode.lambda.real() >= mode.lambda.real()) continue;
      track.place = point;
      track.mode = mode;
    }
  std::vector<Track> unstable;
  for (const auto& [key, track] : tracks)
    if (track.unstable > 0) unstable.push_back(track);
  return unstable;
}

/// Where a point, a threshold or a track is.
void add_place(Entry out, const char* meaning, const SweptPlace& place)
{
  out.brief("values", "units of the keys", meaning, place.values);
  out.show("direction", "-", "1: rotation as in the scene, -1: reversed", place.reversed ? -1 : 1);
}

/// Where a line of a table is: a value of each number.
void add_line_place(Entry out, const SweptPlace& place)
{
  for (std::size_t i = 0; i < place.values.size(); ++i)
    out.add(out.scene().sweep->key[i], "unit of the key", "value of the number", place.values[i]);
  if (out.is_example()) out.add("<key>", "unit of the key", "value of each number", 0);
  out.add("direction", "-", "1: rotation as in the scene, -1: reversed", place.reversed ? -1 : 1);
}

void add_point(Entry out, const SweepPoint& point)
{
  add_place(out, "value of each number", point);
  out.add("outcome", "word", "`converged`, or how the point failed", word(point.outcome.kind));
  out.text("reason", "why it failed", point.outcome.reason);
  out.add("inserted", "switch", "between the scene's points, where pairs or modes change much", point.inserted);
  out.add("closed", "-", "closed pairs", point.closed);
  out.show("unstable_modes", "-", "unstable modes in the band", point.unstable);
  if (out.has(!point.modes.empty()))
  {
    const std::complex<double> lambda = point.modes.empty() ? 0 : point.modes.front().lambda;
    out.show("growth_rate", "1/s", "growth rate of the least stable mode", lambda.real());
    out.show("frequency_hz", "Hz", "frequency of that mode", frequency_hz_of(lambda));
  }
}

void add_track(Entry out, const Track& track)
{
  out.show("track", "-", "number of a mode that is unstable somewhere in that direction", track.number);
  out.show("points", "-", "points in that direction where it was found", track.points);
  out.show("unstable_points", "-", "those of them where it is unstable", track.unstable);
  out.show("least_mac", "-", "its least MAC", track.least_mac);
  out.brief("greatest_growth_rate", "1/s", "its greatest growth rate", track.mode.lambda.real());
  out.brief("frequency_hz", "Hz", "its frequency there", frequency_hz_of(track.mode.lambda));
  add_place(out, "where that is", track.place);
}

void add_threshold(Entry out, const Threshold& threshold)
{
  add_place(out, "where a mode becomes unstable or stable along the first number", threshold);
  out.show("error", "unit of the key", "length of the interval that holds the first value", threshold.error);
  out.show("track", "-", "number of the mode", threshold.track);
  out.brief("frequency_hz", "Hz", "its frequency there", threshold.frequency_hz);
  out.brief("change", "-", "change of the number of unstable modes with a rising number", threshold.change);
}

/// A mode of a point; null: the point has none.
void add_mode(Entry out, const SweepPoint& point, const SweptMode* mode)
{
  add_line_place(out, point);
  out.add("inserted", "switch", "as `sweep.points[].inserted`", point.inserted);
  out.add("outcome", "word", "as `sweep.points[].outcome`", word(point.outcome.kind));
  out.add("closed_pairs", "-", "closed pairs", point.closed);
  if (!mode) return;
  out.add("track", "-", "number of the followed mode; empty: none", mode->track < 0 ? Json() : Json(mode->track));
  out.add("frequency_hz", "Hz", "its frequency", frequency_hz_of(mode->lambda));
  out.add("growth_rate", "1/s", "its growth rate", mode->lambda.real());
  out.add("damping_ratio", "-", "its damping ratio", damping_ratio_of(mode->lambda));
  out.add("backward_error", "-", "the larger one of its right and its left vector", mode->backward_error);
  out.add("mac", "-", "MAC with the mode of this track at the point before", mode->mac);
  out.add("subspace", "-", "modes that were followed together and share this MAC", mode->subspace);
}

/// The value below which a part of an ascending list is.
double part_of(const std::vector<double>& ascending, double part)
{
  if (ascending.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double place = part * static_cast<double>(ascending.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, ascending.size() - 1);
  return ascending[below] + (place - static_cast<double>(below)) * (ascending[above] - ascending[below]);
}

void add_probability(Entry out, const char* meaning, const Probability& probability)
{
  out.show("unstable_samples", "-", meaning, probability.count);
  out.brief("probability", "-", "their part of all with an equilibrium", probability.estimate());
  out.brief("lower", "-", "lower end of its interval", probability.lower);
  out.brief("upper", "-", "upper end of its interval", probability.upper);
}

void add_random_mode(Entry out, const RobustMode& mode)
{
  const auto &growth = mode.growth_rates, &frequency = mode.frequencies;
  out.add("mode", "-", "number of a mode of the medians; -1: modes like none of them", mode.number);
  if (out.has(mode.number >= 0))
  {
    out.brief("median_frequency_hz", "Hz", "its frequency at the medians", frequency_hz_of(mode.lambda));
    out.add("median_growth_rate", "1/s", "its growth rate there", mode.lambda.real());
  }
  add_probability(out, "samples where it is unstable", mode.unstable);
  out.add("growth_rate_5", "1/s", "5 % of the growth rates where it is unstable lie below", part_of(growth, 0.05));
  out.show("growth_rate_50", "1/s", "50 % lie below", part_of(growth, 0.5));
  out.add("growth_rate_95", "1/s", "95 % lie below", part_of(growth, 0.95));
  out.add("frequency_hz_5", "Hz", "5 % of the frequencies where it is unstable lie below", part_of(frequency, 0.05));
  out.add("frequency_hz_50", "Hz", "50 % lie below", part_of(frequency, 0.5));
  out.add("frequency_hz_95", "Hz", "95 % lie below", part_of(frequency, 0.95));
}

void add_number(Entry out, const UncertainNumber& number, double correlation)
{
  add_key(out, "random number", number.key);
  out.show("distribution", "its distribution", number.distribution);
  out.show("rank_correlation", "-", "Spearman's, with the largest growth rate over abs(lambda)", correlation);
}

void add_random_sample(Entry out, const SweepPoint& sample)
{
  for (std::size_t i = 0; i < sample.values.size(); ++i)
    out.add(out.scene().uncertain[i].key, "unit of the key", "value of the random number", sample.values[i]);
  if (out.is_example()) out.add("<key>", "unit of the key", "value of each random number", 0);
  const SweptMode worst = sample.modes.empty() ? SweptMode{} : least_stable(sample);
  out.add("known", "-", "1: there is an equilibrium", sample.outcome.kind == OutcomeKind::converged ? 1 : 0);
  out.add("closed_pairs", "-", "closed pairs", sample.closed);
  out.add("unstable_modes", "-", "unstable modes in the band", sample.unstable);
  out.add("growth_rate", "1/s", "greatest growth rate over abs(lambda)", worst.lambda.real());
  out.add("frequency_hz", "Hz", "frequency of that mode", frequency_hz_of(worst.lambda));
  out.add("mode", "-", "its number in `robustness.modes[]` if it is unstable; -1: none",
          is_unstable(worst.lambda) ? worst.track : -1);
}

} // namespace

void add_sweep(Entry out, const Report& report)
{
  const Sweep& sweep = report.sweep;
  const SweepSettings& settings = *out.scene().sweep;
  std::vector<std::string> names, units;
  for (const std::string& key : settings.key)
  {
    const NumberDescription number = description_of(out.scene(), key);
    names.push_back(number.name.empty() ? key : number.name);
    units.push_back(number.unit);
  }
  const auto unstable = std::ranges::count_if(sweep.points, [](const SweepPoint& point) { return point.unstable > 0; });
  out.show("keys", "text", "numbers that are swept", settings.key);
  out.show("names", "text", "what each is of, by its name; the key where that says it", names);
  out.show("units", "text", "unit of each", units);
  out.add("stages", "stages at each point, as the scene says", settings.stages);
  out.add("directions", "directions of rotation, as the scene says", settings.directions);
  out.show("unstable_points", "-", "points where a mode is unstable", unstable);
  out.show("followed_modes", "-", "modes that were followed; their tracks count from 0", sweep.tracks);
  out.show("lost_modes", "-", "times that a mode of the band was not found again at the next point", sweep.lost);
  out.show("steps_cut_short", "-", "steps that need more points: modes may be mistaken", sweep.cut_short);
  out.show("least_mac", "-", "least MAC of a followed mode with the point before", sweep.least_mac);
  out.show("least_mac_across", "-", "least MAC where pairs open or close; 1: none below 0.9", sweep.least_mac_across);
  out.show("residual", "-", "largest backward error of right and left vectors", sweep.outcome.residual);
  out.add("basis_shapes", "-", "shapes of the basis in the end", sweep.basis);
  out.add("basis_corrections", "-", "corrections of the basis by residuals", sweep.passes);
  out.list("points", add_point, sweep.points);
  out.list("unstable_tracks", add_track, unstable_tracks(sweep));
  out.list("thresholds", add_threshold, sweep.thresholds);
}

Result sweep_modes(const Sweep& sweep, const Scene& scene, Content content)
{
  Result rows{.kind = Result::Kind::list};
  const Entry out(rows, scene, content);
  if (const SweptMode any; out.is_example()) add_mode(out.group(""), {}, &any);
  for (const SweepPoint& point : sweep.points)
    if (point.modes.empty())
      add_mode(out.group(""), point, nullptr);
    else
      for (const SweptMode& mode : point.modes) add_mode(out.group(""), point, &mode);
  return rows;
}

void add_robustness(Entry out, const Report& report)
{
  const Robustness& robustness = report.robustness;
  out.brief("samples", "-", "number of samples", robustness.samples.size());
  out.show("confidence", "-", "confidence of the intervals", out.scene().robustness->confidence);
  add_probability(out.group("any"), "samples with an unstable mode", robustness.any);
  out.show("basis_shapes", "-", "shapes of the basis", robustness.basis);
  out.check(robustness.outcome.kind == OutcomeKind::converged, "residual", "-",
            "largest backward error of right and left vectors in the full problem", robustness.outcome.residual);
  out.list("modes", add_random_mode, robustness.modes);
  out.list("numbers", add_number, out.scene().uncertain, robustness.correlation);
}

Result robustness_samples(const Robustness& robustness, const Scene& scene, Content content)
{
  Result rows;
  Entry(rows, scene, content).list("samples", add_random_sample, robustness.samples);
  return std::move(rows.parts.front());
}

} // namespace squeal
