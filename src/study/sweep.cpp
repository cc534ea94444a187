#include "squeal/study/sweep.hpp"

#include "following.hpp"
#include "squeal/base/run_control.hpp"
#include "sweeper.hpp"

#include <algorithm>
#include <map>

namespace squeal
{

namespace
{

std::vector<SweepLine> lines_of(const SweepSettings& settings)
{
  SweepLine line{settings.design, false, settings.design.empty()};
  std::vector<double> values = settings.values;
  std::ranges::sort(values);
  if (line.ordered && values.empty())
    for (int i = 0; i < settings.points; ++i)
      values.push_back(settings.from + i * (settings.to - settings.from) / (settings.points - 1));
  for (const double value : values) line.points.push_back({value});
  std::vector<SweepLine> lines{line};
  line.reversed = true;
  if (settings.directions == SweepDirections::both) lines.push_back(line);
  return lines;
}

using TrackNames = std::map<int, int>; // of a line, to those of the whole

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

/// Adds what was found along a line. Its tracks get the names that its first modes have at the start in the other
/// direction of rotation, where friction is weak; else new ones.
void add(Sweep& whole, const Sweep& part)
{
  TrackNames names;
  if (!part.points.empty() && !whole.points.empty()) names = names_by(part.points.front(), whole.points.front());
  const auto rename = [&](int& track)
  {
    if (track < 0) return;
    const auto [name, is_new] = names.try_emplace(track, whole.tracks);
    whole.tracks += is_new;
    track = name->second;
  };
  for (SweepPoint point : part.points)
  {
    for (SweptMode& mode : point.modes) rename(mode.track);
    whole.points.push_back(std::move(point));
  }
  for (Threshold threshold : part.thresholds)
  {
    rename(threshold.track);
    whole.thresholds.push_back(std::move(threshold));
  }
  whole.lost += part.lost;
  whole.cut_short += part.cut_short;
  whole.least_mac = std::min(whole.least_mac, part.least_mac);
  whole.least_mac_across = std::min(whole.least_mac_across, part.least_mac_across);
  whole.outcome.residual = std::max(whole.outcome.residual, part.outcome.residual);
  whole.basis = std::max(whole.basis, part.basis);
  whole.passes += part.passes;
}

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
  if (!complete)
    outcome.reason = format("the run was ended %s after %td of %zu points", who_asked_to_end().c_str(),
                            std::ranges::count(sweep.points, false, &SweepPoint::inserted), total);
  const auto note = [&](bool inserted, const std::string& what)
  {
    int failed = 0;
    std::string first;
    for (const SweepPoint& point : sweep.points)
      if (point.inserted == inserted && !succeeded(point.outcome) && ++failed == 1)
        first = place_of(point, keys) + ": " + point.outcome.reason;
    if (failed == 0) return;
    if (complete && !inserted) outcome.kind = OutcomeKind::not_converged; // modes are followed without those put in
    outcome.reason +=
        (outcome.reason.empty() ? "" : "; ") + format("%d %s failed, the first at ", failed, what.c_str()) + first;
  };
  note(false, format("of %zu points", total));
  note(true, format("of %td points put in between", std::ranges::count(sweep.points, true, &SweepPoint::inserted)));
}

} // namespace

Sweep run_sweep(const SweepProblem& problem, MPI_Comm comm)
{
  const std::vector<SweepLine> lines = lines_of(problem.settings);
  std::size_t total = 0;
  for (const SweepLine& line : lines) total += line.points.size();
  Sweep sweep;
  sweep.outcome.kind = OutcomeKind::converged;
  for (const Sweep& found : visit(problem, comm, lines))
  {
    add(sweep, found);
    if (found.outcome.kind == OutcomeKind::interrupted) sweep.outcome.kind = OutcomeKind::interrupted;
  }
  assess(sweep, problem.settings.key, total);
  return sweep;
}

} // namespace squeal
