#include "sweep_results.hpp"

#include "derived.hpp"
#include "squeal/scene/numbers.hpp"
#include "sweep_motion_results.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

namespace squeal
{

namespace
{

using Json = nlohmann::ordered_json;

/// Of a point or a threshold.
template <class At> int direction_of(const At& at)
{
  return at.reversed ? -1 : 1;
}

/// A followed mode in one direction of rotation, where it grows most.
struct Track
{
  int number = 0;
  const SweepPoint* point = nullptr;
  const SweptMode* mode = nullptr;
  int points = 0, unstable = 0; // where it was found, and where it is unstable
  double least_mac = 1;
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
      track.number = mode.track;
      ++track.points;
      track.unstable += is_unstable(mode.lambda);
      track.least_mac = std::min(track.least_mac, mode.mac);
      if (track.mode && track.mode->lambda.real() >= mode.lambda.real()) continue;
      track.point = &point;
      track.mode = &mode;
    }
  std::vector<Track> unstable;
  for (const auto& [key, track] : tracks)
    if (track.unstable > 0) unstable.push_back(track);
  return unstable;
}

Json point_entry(const SweepPoint& point)
{
  Json entry = {{"values", point.values}, {"direction", direction_of(point)}};
  entry["outcome"] = word(point.outcome.kind);
  if (!point.outcome.reason.empty()) entry["reason"] = point.outcome.reason;
  entry["inserted"] = point.inserted;
  entry["closed"] = point.closed;
  entry["unstable_modes"] = point.unstable;
  if (point.modes.empty()) return entry;
  entry["growth_rate"] = point.modes.front().lambda.real();
  entry["frequency_hz"] = frequency_hz_of(point.modes.front().lambda);
  return entry;
}

/// Of points whose modes are not followed.
std::string unstable_points_text(const Sweep& sweep)
{
  const SweepPoint* most = nullptr;
  for (const SweepPoint& point : sweep.points)
    if (point.unstable > 0 && (!most || most->modes.front().lambda.real() < point.modes.front().lambda.real()))
      most = &point;
  const auto count = std::ranges::count_if(sweep.points, [](const SweepPoint& point) { return point.unstable > 0; });
  std::string text = format("unstable at %td of %zu points", count, sweep.points.size());
  if (!most) return text;
  const std::complex<double> lambda = most->modes.front().lambda;
  return text + format(", most at %s%s: %.7g Hz, growth %.6g 1/s", text_of(most->values).c_str(),
                       most->reversed ? " reversed" : "", frequency_hz_of(lambda), lambda.real());
}

} // namespace

std::string text_of(const std::vector<double>& values)
{
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + format("%.7g", value);
  return text;
}

void add_sweep(const Sweep& sweep, const Scene& scene, Json& entry)
{
  const SweepSettings& settings = *scene.sweep;
  entry["keys"] = settings.key;
  for (const std::string& key : settings.key)
  {
    entry["names"].push_back(name_of_number(scene, key));
    entry["units"].push_back(unit_of_number(scene, key));
  }
  entry["stages"] = word(settings.stages);
  entry["directions"] = word(settings.directions);
  entry["followed_modes"] = sweep.tracks;
  entry["lost_modes"] = sweep.lost;
  entry["steps_cut_short"] = sweep.cut_short;
  entry["least_mac"] = sweep.least_mac;
  entry["least_mac_across"] = sweep.least_mac_across;
  entry["residual"] = sweep.outcome.residual;
  entry["basis_shapes"] = sweep.basis;
  entry["basis_corrections"] = sweep.passes;
  entry["groups"] = sweep.groups;
  entry["points"] = Json::array();
  for (const SweepPoint& point : sweep.points)
  {
    Json& added = entry["points"].emplace_back(point_entry(point));
    if (point.motion) added["motion"] = motion_entry(*point.motion, scene);
  }
  entry["unstable_tracks"] = Json::array();
  for (const Track& track : unstable_tracks(sweep))
    entry["unstable_tracks"].push_back({{"track", track.number},
                                        {"points", track.points},
                                        {"unstable_points", track.unstable},
                                        {"least_mac", track.least_mac},
                                        {"greatest_growth_rate", track.mode->lambda.real()},
                                        {"frequency_hz", frequency_hz_of(track.mode->lambda)},
                                        {"values", track.point->values},
                                        {"direction", direction_of(*track.point)}});
  entry["thresholds"] = Json::array();
  for (const Threshold& threshold : sweep.thresholds)
    entry["thresholds"].push_back({{"values", threshold.values},
                                   {"direction", direction_of(threshold)},
                                   {"error", threshold.error},
                                   {"track", threshold.track},
                                   {"frequency_hz", threshold.frequency_hz},
                                   {"change", threshold.change}});
}

void write_sweep(Hdf5File& file, const Sweep& sweep, const Scene& scene)
{
  const std::size_t points = sweep.points.size(), tracks = static_cast<std::size_t>(sweep.tracks);
  const double none = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> values, frequency(points * tracks, none), growth(points * tracks, none),
      mac(points * tracks, none);
  std::vector<int> direction, closed, unstable;
  for (std::size_t i = 0; i < points; ++i)
  {
    const SweepPoint& point = sweep.points[i];
    values.insert(values.end(), point.values.begin(), point.values.end());
    direction.push_back(direction_of(point));
    closed.push_back(point.closed);
    unstable.push_back(point.unstable);
    for (const SweptMode& mode : point.modes)
    {
      if (mode.track < 0) continue;
      const std::size_t place = i * tracks + static_cast<std::size_t>(mode.track);
      frequency[place] = frequency_hz_of(mode.lambda);
      growth[place] = mode.lambda.real();
      mac[place] = mode.mac;
    }
  }
  if (points == 0) return;
  file.write("sweep/value", {points, values.size() / points}, values, "units of the keys");
  file.write("sweep/direction", {points}, direction, "1 as in the scene, -1 reversed");
  file.write("sweep/closed", {points}, closed, "pairs");
  file.write("sweep/unstable_modes", {points}, unstable, "-");
  write_motions(file, sweep, scene);
  if (tracks == 0) return;
  file.write("sweep/frequency", {points, tracks}, frequency, "Hz");
  file.write("sweep/growth_rate", {points, tracks}, growth, "1/s");
  file.write("sweep/mac", {points, tracks}, mac, "-");
}

std::string sweep_csv(const Sweep& sweep, const Scene& scene)
{
  std::string text;
  for (const std::string& key : scene.sweep->key) text += csv_text(key) + ",";
  text += "direction,inserted,outcome,closed_pairs,track,frequency_hz,growth_rate,damping_ratio,backward_error,mac,"
          "subspace\n";
  for (const SweepPoint& point : sweep.points)
  {
    std::string head;
    for (const double value : point.values) head += format("%.17g,", value);
    head += format("%d,%d,%s,%d,", direction_of(point), point.inserted ? 1 : 0, word(point.outcome.kind), point.closed);
    if (point.modes.empty()) text += head + ",,,,,,\n";
    for (const SweptMode& mode : point.modes)
      text += head + (mode.track < 0 ? "" : std::to_string(mode.track)) +
              format(",%.17g,%.17g,%.17g,%.3g,%.6g,%d\n", frequency_hz_of(mode.lambda), mode.lambda.real(),
                     damping_ratio_of(mode.lambda), mode.backward_error, mode.mac, mode.subspace);
  }
  return text;
}

std::vector<std::string> sweep_lines(const Sweep& sweep, const Scene& scene)
{
  constexpr std::size_t shown = 12;
  if (sweep.points.empty()) return {};
  std::string keys;
  for (const std::string& key : scene.sweep->key) keys += (keys.empty() ? "" : " and ") + number_text(scene, key);
  std::vector<std::string> lines = {format("%zu points of %s", sweep.points.size(), keys.c_str())};
  if (scene.sweep->stages == SweepStages::equilibrium) return lines;
  lines.back() += format("; backward error %.1e at most, on a basis of %d shapes after %d corrections",
                         sweep.outcome.residual, sweep.basis, sweep.passes);
  if (sweep.groups > 1) lines.back() += format(", by %d groups of ranks", sweep.groups);
  if (sweep.tracks > 0)
  {
    lines.push_back(
        format("%d modes followed, MAC %.3f at least, %d lost on the way", sweep.tracks, sweep.least_mac, sweep.lost));
    if (sweep.least_mac_across < 1)
      lines.back() += format("; MAC %.3f at least where pairs open or close", sweep.least_mac_across);
  }
  else
    lines.push_back(unstable_points_text(sweep));
  if (sweep.cut_short > 0)
    lines.push_back(format("WARNING: in %d of the steps more points in between are needed than are put there: "
                           "modes may be mistaken there, and thresholds missed",
                           sweep.cut_short));
  const std::vector<Track> unstable = unstable_tracks(sweep);
  for (std::size_t i = 0; i < std::min(shown, unstable.size()); ++i)
  {
    const Track& track = unstable[i];
    lines.push_back(format("mode %d unstable at %d of %d points%s, most at %s: %.7g Hz, growth %.6g 1/s", track.number,
                           track.unstable, track.points, track.point->reversed ? " reversed" : "",
                           text_of(track.point->values).c_str(), frequency_hz_of(track.mode->lambda),
                           track.mode->lambda.real()));
  }
  for (std::size_t i = 0; i < std::min(shown, sweep.thresholds.size()); ++i)
  {
    const Threshold& t = sweep.thresholds[i];
    lines.push_back(format("threshold of mode %d at %s%s +- %.1e, %.7g Hz (%+d)", t.track, text_of(t.values).c_str(),
                           t.reversed ? " reversed" : "", t.error, t.frequency_hz, t.change));
  }
  if (sweep.thresholds.size() > shown || unstable.size() > shown)
    lines.emplace_back("the rest is in report.json and sweep.csv");
  for (std::string& line : motion_lines(sweep)) lines.push_back(std::move(line));
  return lines;
}

} // namespace squeal
