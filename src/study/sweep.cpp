/// The points of a sweep, visited line by line: modes are followed, and thresholds are sought on the way
/// (src/README.md, sections 10.1 to 10.5).
#include "squeal/study/sweep.hpp"

#include "point_modes.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"
#include "swept_model.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

namespace squeal
{

namespace
{

/// Backward errors at points put in between, which tell which mode goes where, and where it changes its stability: they
/// leave eigenvalues within 3e-5. Each is in a state of contact of its own, whose shapes would make the basis several
/// times as large.
constexpr double inserted_tolerance = 1e-6;
constexpr double threshold_tolerance = 1e-5; // of the number's larger end
constexpr std::size_t prepared = 16;         // design points whose closed pairs tell those of the basis
constexpr int most_halvings = 6;             // of a step
constexpr PetscInt most_between = 100;       // points put into a step where modes are unclear or pairs open or close
constexpr int many_changes = 2; // of contact in a step: beyond, a half may need fewer; two bodies alike change at once

/// Points along the number in one direction of rotation; or design points.
struct SweepLine
{
  std::vector<std::vector<double>> points; // values of the numbers
  bool reversed = false;                   // direction of rotation
  bool ordered = true; // modes can be followed from point to point; else they are named by the first
};

class Sweeper
{
public:
  Sweeper(const SweepProblem& problem, MPI_Comm comm)
      : problem_(problem), comm_(comm), model_(problem, [comm] { end_if_asked(comm); })
  {
  }

  /// Visits these lines. Where the run is asked to end, the points done stay.
  Sweep run(const std::vector<SweepLine>& lines)
  {
    sweep_.outcome.kind = OutcomeKind::converged;
    try
    {
      prepare(lines);
      for (const SweepLine& line : lines) run_line(line);
    }
    catch (const Interrupted&) // on all ranks alike
    {
      sweep_.outcome.kind = OutcomeKind::interrupted;
    }
    sweep_.basis = static_cast<int>(model_.shapes());
    sweep_.passes = model_.passes();
    return std::move(sweep_);
  }

private:
  /// Finds the pairs that are closed at every point, of design points at the first ones.
  void prepare(const std::vector<SweepLine>& lines)
  {
    std::size_t points = 0;
    for (const SweepLine& line : lines) points += line.points.size();
    progress_.emplace(comm_, problem_.name, static_cast<double>(points));
    for (const SweepLine& line : lines)
      for (const std::vector<double>& values :
           std::span(line.points).first(line.ordered ? line.points.size() : std::min(line.points.size(), prepared)))
      {
        end_if_asked(comm_);
        model_.prepare({values, line.reversed});
      }
  }

  void run_line(const SweepLine& line)
  {
    std::optional<Followed> before;
    for (const std::vector<double>& values : line.points)
    {
      end_if_asked(comm_);
      std::optional<Followed> now = evaluate({{values, line.reversed}});
      progress_->update(static_cast<double>(++done_), "");
      if (!now) continue;
      if (!first_ || (line.ordered && !before))
        begin(*now);
      else if (line.ordered)
      {
        Division division = division_between(*before, *now);
        advance(*before, *now, 0, division);
        sweep_.cut_short += division.cut_short;
      }
      else
      {
        now->tracks = names_by_shapes(first_->modes, now->modes);
        record(*now, {});
        model_.forget(*now);
      }
      before = std::move(now);
    }
  }

  /// The modes at a point; nothing if it fails, which is recorded. A point between others is recorded once, though a
  /// step may be divided there for several reasons.
  std::optional<Followed> evaluate(Followed point)
  {
    if (find_modes_of(point)) return point;
    const SweptPlace& place = point;
    const auto recorded = [&](const SweepPoint& known) { return known.inserted && known == place; };
    if (!point.inserted || std::ranges::none_of(sweep_.points, recorded)) record(point, {});
    return std::nullopt;
  }

  /// Returns false if the point fails.
  bool find_modes_of(Followed& point)
  {
    end_if_asked(comm_);
    const Equilibrium& at = model_.equilibrium_at(point);
    point.closed = static_cast<int>(std::ranges::count(at.closed, 1));
    point.modes.outcome = at.outcome;
    if (at.outcome.kind == OutcomeKind::converged && problem_.settings.stages == SweepStages::modes)
      point.modes = model_.modes_at(point, point.inserted ? inserted_tolerance : close_tolerance);
    if (point.modes.outcome.kind == OutcomeKind::converged) return true;
    point.modes.pairs.clear(); // of which some may be no modes
    return false;
  }

  /// The first point of a line. In the other direction of rotation its modes take the tracks of those of the
  /// first point that they match, as where friction is weak.
  void begin(Followed& now)
  {
    now.tracks.assign(now.modes.pairs.size(), -1);
    if (first_)
    {
      const std::vector<Match> matches = follow(forms_between(first_->modes, now.modes), clear_mac_across);
      for (std::size_t i = 0; i < matches.size(); ++i)
        if (matches[i].to >= 0) now.tracks[static_cast<std::size_t>(matches[i].to)] = first_->tracks[i];
    }
    for (int& track : now.tracks)
      if (track < 0) track = sweep_.tracks++;
    if (!first_) first_ = now;
    record(now, {});
  }

  /// The least MAC of a clear match where a step cannot be halved any further.
  double least_clear(const Followed& before, const Followed& now)
  {
    return model_.same_pairs_closed(before, now) ? clear_mac : clear_mac_across;
  }

  /// How finely a step between two points of a line is divided.
  struct Division
  {
    double tolerance = 0;    // of the first number: what is found between two points is found to it
    std::ptrdiff_t left = 0; // changes of contact that may still divide it
    PetscInt points = 0;     // that may still be put in between
    bool cut_short = false;  // it needed more
  };

  /// Each pair changes once on the way, or a few do more often; more say that equilibria jump.
  Division division_between(const Followed& before, const Followed& now)
  {
    const double size = std::max(std::abs(before.values[0]), std::abs(now.values[0]));
    const Equilibrium& at = model_.equilibrium_at(now);
    const bool modes = problem_.settings.stages == SweepStages::modes; // which alone jump
    return {threshold_tolerance * size, modes ? std::ssize(at.closed) : 0, most_between};
  }

  /// Follows the modes to a point. Points come between where modes are unclear. They come on both sides of changes of
  /// contact where a mode is unclear or may change its stability. Seeks the thresholds on the way.
  void advance(Followed& before, Followed& now, int depth, Division& division)
  {
    const bool divisible = std::abs(now.values[0] - before.values[0]) > division.tolerance;
    const ModeForms between_both = forms_between(before.modes, now.modes);
    std::vector<Match> matches = follow(between_both, clear_mac);
    const bool clear = all_clear(before, matches);
    if (divisible && (!clear || may_change_stability(before, now, matches)) &&
        divided(before, now, depth, clear, division))
      return;
    if (!clear) matches = follow(between_both, least_clear(before, now));
    take_tracks(before, now, matches, division.tolerance);
    record(now, matches_at(now, matches));
  }

  /// Follows the modes by parts of the step, if it has any reason to be divided and points are left for it.
  bool divided(Followed& before, Followed& now, int depth, bool clear, Division& division)
  {
    const bool halvable = depth < most_halvings;
    const int changed = model_.changed_pairs(before, now);
    const bool many = changed > many_changes && halvable, halves = many || (halvable && !clear);
    if (!halves && (changed == 0 || division.left == 0)) return false;
    if (division.points <= 0)
    {
      division.cut_short = true;
      return false;
    }
    if (changed > 0 && !many && divided_at_contact_change(before, now, depth, division)) return true;
    if (halves)
    {
      const double middle = (before.values[0] + now.values[0]) / 2;
      if (std::optional<Followed> between = put_between(now, middle, division))
      {
        advance_by_parts(before, *between, now, depth + 1, division);
        return true;
      }
    }
    return many && divided_at_contact_change(before, now, depth, division);
  }

  /// Through a point in between. Either part has half of the points that may still be put in, and the second what the
  /// first leaves.
  void advance_by_parts(Followed& before, Followed& between, Followed& now, int depth, Division& division)
  {
    const PetscInt of_second = division.points / 2;
    division.points -= of_second;
    advance(before, between, depth, division);
    division.points += of_second;
    advance(between, now, depth, division);
  }

  std::optional<Followed> put_between(const Followed& of_line, double value, Division& division)
  {
    --division.points;
    progress_->update(static_cast<double>(done_), format("a point in between, at %.6g", value));
    return evaluate(between_points(of_line, value));
  }

  /// Whether a mode in the band may change its stability on the way. At one end its growth rate is then no farther from
  /// zero than both are from each other. Any other would need a way of three times that length.
  bool may_change_stability(const Followed& before, const Followed& now, const std::vector<Match>& matches) const
  {
    const std::vector<DenseEigenpair>&from = before.modes.pairs, &to = now.modes.pairs;
    const double band = problem_.modes.band;
    std::vector<char> matched(to.size(), 0);
    for (std::size_t i = 0; i < matches.size(); ++i)
    {
      if (matches[i].to < 0) continue; // unclear, or leaves the band
      const auto place = static_cast<std::size_t>(matches[i].to);
      matched[place] = 1;
      if (!in_band(from[i], band) && !in_band(to[place], band)) continue;
      const double a = from[i].lambda.real(), b = to[place].lambda.real();
      if (std::min(std::abs(a), std::abs(b)) <= std::abs(a - b)) return true;
    }
    for (std::size_t k = 0; k < to.size(); ++k)
      if (!matched[k] && in_band(to[k], band) && is_unstable(to[k].lambda)) return true;
    return false;
  }

  /// Modes jump where pairs open or close: a mode may be unstable up to there alone, and neither end shows it.
  bool divided_at_contact_change(Followed& before, Followed& now, int depth, Division& division)
  {
    if (division.left == 0) return false;
    const std::optional<ContactChange> change = model_.contact_change(before, now, division.tolerance);
    if (!change) return false;
    --division.left;
    if (change->failed)
    {
      evaluate(between_points(now, *change->failed)); // which records it
      return false;
    }
    std::deque<Followed> sides; // which stay where they are
    for (const double value : {change->before, change->behind})
    {
      if (value == before.values[0] || value == now.values[0]) continue;
      std::optional<Followed> side = put_between(now, value, division);
      if (!side) return false;
      sides.push_back(std::move(*side));
    }
    if (sides.empty()) return false;
    Followed* last = &before;
    for (Followed& side : sides)
    {
      advance(*last, side, depth, division);
      last = &side;
    }
    advance(*last, now, depth, division);
    return true;
  }

  /// A point of the same line that is none of the scene.
  static Followed between_points(const Followed& of_line, double value)
  {
    Followed point{of_line, true};
    point.values[0] = value;
    return point;
  }

  /// Whether every mode in the band is found again. Those near its end may leave.
  bool all_clear(const Followed& before, const std::vector<Match>& matches) const
  {
    for (std::size_t i = 0; i < matches.size(); ++i)
      if (matches[i].to < 0 && in_band(before.modes.pairs[i], problem_.modes.band)) return false;
    return true;
  }

  /// Seeks the thresholds on the way. The modes found meanwhile are nearer to each other than those of both ends, and
  /// tracks go by them. Where one of those is unclear they go by both ends.
  void take_tracks(const Followed& before, Followed& now, const std::vector<Match>& matches, double tolerance)
  {
    const auto point_at = [&](double value) { return evaluate(between_points(now, value)); };
    const auto match = [&](const Followed& from, const Followed& to)
    { return follow(forms_between(from.modes, to.modes), least_clear(from, to)); };
    for (Threshold& threshold :
         find_thresholds({point_at, match, problem_.modes.band, tolerance, sweep_.tracks}, before, now, matches))
      sweep_.thresholds.push_back(std::move(threshold));
    const auto has = [&](int track) { return std::ranges::find(now.tracks, track) != now.tracks.end(); };
    for (std::size_t i = 0; i < matches.size(); ++i)
    {
      if (matches[i].to >= 0)
      {
        int& track = now.tracks[static_cast<std::size_t>(matches[i].to)];
        if (track < 0 && !has(before.tracks[i])) track = before.tracks[i];
        double& least = matches[i].mac < clear_mac ? sweep_.least_mac_across : sweep_.least_mac;
        least = std::min(least, matches[i].mac);
      }
      if (in_band(before.modes.pairs[i], problem_.modes.band) && !has(before.tracks[i])) ++sweep_.lost;
    }
    for (int& track : now.tracks)
      if (track < 0) track = sweep_.tracks++;
  }

  /// The matches by the modes of the later point.
  static std::vector<Match> matches_at(const Followed& now, const std::vector<Match>& matches)
  {
    std::vector<Match> result(now.modes.pairs.size());
    for (const Match& match : matches)
      if (match.to >= 0) result[static_cast<std::size_t>(match.to)] = match;
    return result;
  }

  void record(const Followed& now, const std::vector<Match>& matches)
  {
    SweepPoint point{now, now.inserted, now.modes.outcome, now.closed, 0, {}};
    for (std::size_t k = 0; k < now.modes.pairs.size(); ++k)
    {
      const DenseEigenpair& pair = now.modes.pairs[k];
      const bool inside = in_band(pair, problem_.modes.band);
      point.unstable += inside && is_unstable(pair.lambda);
      const Match match = matches.empty() ? Match{0, 1, 1} : matches[k];
      if (inside)
        point.modes.push_back({pair.lambda, now.modes.errors[k], now.tracks.empty() ? -1 : now.tracks[k],
                               match.to >= 0 ? match.mac : 1, match.subspace});
    }
    if (point.outcome.kind == OutcomeKind::converged)
      sweep_.outcome.residual = std::max(sweep_.outcome.residual, point.outcome.residual);
    sweep_.points.push_back(std::move(point));
  }

  const SweepProblem& problem_;
  const MPI_Comm comm_;
  SweptModel model_;
  Sweep sweep_;
  std::optional<Followed> first_{}; // point of all lines
  std::optional<Progress> progress_;
  std::size_t done_ = 0; // points
};

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
  Sweep sweep = Sweeper(problem, comm).run(lines);
  assess(sweep, problem.settings.key, total);
  return sweep;
}

} // namespace squeal
