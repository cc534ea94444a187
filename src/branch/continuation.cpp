#include "squeal/branch/continuation.hpp"

#include "corrector.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// One side of a branch, from its start on.
struct BranchSide
{
  std::vector<BranchPoint> orbits; // the start first
  std::vector<BranchEvent> events;
  std::array<KnownBeyond, 2> known; // multipliers
  BranchEnding ending = BranchEnding::number_of_points;
};

/// Measures changes about an orbit, and the distances of states from the rest of its parameter.
void refer_to(BranchCorrector& corrector, BranchPoint& point)
{
  corrector.family.set_parameter(point.parameter);
  corrector.rest = corrector.family.rest();
  corrector.period = point.orbit.period;
  point.orbit.fluctuation = energy_norm(corrector.family.flow, fluctuation_of(problem_of(corrector), point.orbit));
  corrector.scales.fluctuation = point.orbit.fluctuation;
  corrector.scales.period = point.orbit.period;
}

/// Steps along a branch.
struct Walk
{
  BorderedVector tangent; // of scaled length 1
  double length, least, greatest;
};

/// The part of the unit step that the parameter may make.
double limited(const BranchCorrector& corrector, const Walk& walk)
{
  const double share = std::abs(walk.tangent.parameter) / corrector.scales.parameter;
  return std::min(walk.length, 1.5 / corrector.settings.points / std::max(share, 1e-12));
}

bool inside(const ContinuationSettings& settings, double parameter)
{
  return parameter >= settings.least && parameter <= settings.greatest;
}

/// Takes out of a change what only begins the orbit later.
void remove_shift(const BranchCorrector& corrector, const Orbit& orbit, BorderedVector& change)
{
  const Flow& flow = corrector.family.flow;
  const double along = energy_product(flow, orbit.rate, change.state) / energy_product(flow, orbit.rate, orbit.rate);
  check(VecAXPY(change.state, -along, orbit.rate));
}

/// The orbit a step on, on the bound where the step would pass it; none if it was not found.
std::optional<BranchPoint> step_on(BranchCorrector& corrector, const BranchPoint& from, const Walk& walk, double length)
{
  const ContinuationSettings& settings = corrector.settings;
  BorderedVector predicted = vector_of(from);
  add(length, walk.tangent, predicted);
  if (!inside(settings, predicted.parameter))
  {
    const double bound = std::clamp(predicted.parameter, settings.least, settings.greatest);
    add(-(predicted.parameter - bound) / walk.tangent.parameter, walk.tangent, predicted);
    predicted.parameter = bound;
    return correct(corrector, predicted, {zeros_like(predicted.state), 0, corrector.scales.parameter});
  }
  std::optional<BranchPoint> next = correct(corrector, predicted, walk.tangent);
  if (!next) return next;
  BorderedVector error = vector_of(*next);
  add(-1, predicted, error);
  remove_shift(corrector, next->orbit, error);
  // far from the prediction another branch may have been met
  if (std::sqrt(scaled_product(corrector, error, error)) > 0.5 * length || !inside(settings, next->parameter))
    return {};
  return next;
}

/// The direction from one orbit to the next, of scaled length 1 about the next.
BorderedVector direction_between(const BranchCorrector& corrector, const BranchPoint& from, const BranchPoint& to)
{
  BorderedVector direction = vector_of(to);
  add(-1, vector_of(from), direction);
  remove_shift(corrector, to.orbit, direction);
  scale(1 / std::sqrt(scaled_product(corrector, direction, direction)), direction);
  return direction;
}

/// Measures that the phase of an orbit's start leaves alone: parameter over its range, ln T, ln E.
Eigen::Vector3d without_phase(const BranchCorrector& corrector, const BranchPoint& orbit)
{
  return {orbit.parameter / corrector.scales.parameter, std::log(orbit.orbit.period),
          std::log(orbit.measures.mean_fluctuating_energy)};
}

/// Whether the last orbit is on a part of the side that was passed before, at another phase. A corrector comes to it
/// where contact events leave no orbit of this many steps beyond.
bool went_back(const BranchCorrector& corrector, const BranchSide& side)
{
  constexpr double close = 0.1; // of a segment, from it
  constexpr std::size_t looked_at = 8;
  if (!(side.orbits.back().measures.mean_fluctuating_energy > 0)) return false;
  const std::size_t count = side.orbits.size() - 1;
  const Eigen::Vector3d last = without_phase(corrector, side.orbits.back());
  for (std::size_t i = count - std::min(count, looked_at); i + 1 < count; ++i)
  {
    const Eigen::Vector3d from = without_phase(corrector, side.orbits[i]),
                          along = without_phase(corrector, side.orbits[i + 1]) - from, away = last - from;
    const double part = along.dot(away) / along.squaredNorm();
    if (part > 0 && part < 1 && (away - part * along).norm() < close * along.norm()) return true;
  }
  return false;
}

void note_events(BranchCorrector& corrector, BranchSide& side)
{
  const std::size_t count = side.orbits.size();
  std::vector<BranchEvent> fresh = events_between(corrector, side.orbits[count - 2], side.orbits[count - 1]);
  for (KnownBeyond& known : side.known)
    if (auto crossing = crossing_among(corrector, side.orbits, known)) fresh.push_back(*crossing);
  if (count > 2)
    if (auto fold = fold_among(corrector, {&side.orbits[count - 3], &side.orbits[count - 2], &side.orbits[count - 1]}))
      fresh.push_back(*fold);
  side.events.insert(side.events.end(), fresh.begin(), fresh.end());
}

/// Whether a pair opens, or comes to rest, or friction changes as it slips.
bool is_nonlinear(const PointMeasures& measures)
{
  return measures.open_steps > 0 || measures.stick_steps > 0 || measures.slips_nonlinearly;
}

/// Whether the side has come to its natural end.
std::optional<BranchEnding> natural_end(const ContinuationSettings& settings, const BranchSide& side)
{
  constexpr double small = 0.02; // of the start's fluctuation: the parameter is then within 4e-4 of its change to Hopf
  const BranchPoint &last = side.orbits.back(), &before = side.orbits[side.orbits.size() - 2];
  if (last.parameter == settings.least || last.parameter == settings.greatest) return BranchEnding::bound;
  if (is_nonlinear(before.measures) && !is_nonlinear(last.measures)) return BranchEnding::linear_motion;
  if (last.orbit.fluctuation < small * side.orbits.front().orbit.fluctuation) return BranchEnding::small_amplitude;
  return {};
}

/// Where the branch meets its equilibrium: the parameter is linear in the square of a small amplitude.
BranchEvent hopf_beyond(const BranchPoint& before, const BranchPoint& last)
{
  const double p1 = before.parameter, p2 = last.parameter;
  const double square1 = std::pow(before.orbit.fluctuation, 2), square2 = std::pow(last.orbit.fluctuation, 2);
  const double further = (p2 - p1) * square2 / (square1 - square2);
  return {BranchEventKind::hopf, p2 + further, std::abs(further), last.orbit.period, 0, 0};
}

void end_at_hopf(BranchSide& side)
{
  side.ending = BranchEnding::small_amplitude;
  side.events.push_back(hopf_beyond(side.orbits[side.orbits.size() - 2], side.orbits.back()));
}

/// Whether the last orbits shrink, to a tenth of the start. The parameter is then within 1e-2 of its change to Hopf,
/// and orbits of all sizes nearly solve the same equations.
bool shrinks_to_a_point(const BranchSide& side)
{
  constexpr double small = 0.1;
  if (side.orbits.size() < 2) return false;
  const double last = side.orbits.back().orbit.fluctuation;
  return last < side.orbits[side.orbits.size() - 2].orbit.fluctuation &&
         last < small * side.orbits.front().orbit.fluctuation;
}

/// The part of the range that the branch has passed, of which the way down comes first.
double range_passed(const BranchCorrector& corrector, const BranchSide& side, bool upwards)
{
  const double start = side.orbits.front().parameter;
  double passed = 0; // folds lead back
  for (const BranchPoint& orbit : side.orbits) passed = std::max(passed, std::abs(orbit.parameter - start));
  return upwards ? start - corrector.settings.least + passed : passed;
}

/// The orbit round a corner. Where contact begins or ends to do something the branch may turn at once. What closes
/// beyond has its tangent by the contact there, and the parameter goes back.
std::optional<BranchPoint> step_round_corner(BranchCorrector& corrector, const BranchPoint& from, Walk& walk)
{
  constexpr double longer = 5;
  for (double length = longer * walk.least; length < walk.greatest; length *= longer)
  {
    BorderedVector beyond = vector_of(from);
    add(length, walk.tangent, beyond);
    corrector.family.set_parameter(beyond.parameter);
    Orbit there = evaluate(problem_of(corrector), corrector.log, beyond.state, beyond.period);
    if (!std::isfinite(there.residual)) return {};
    Walk round{tangent_at(corrector, {std::move(there), beyond.parameter, 0}, walk.tangent), length, 0, 0};
    if (round.tangent.parameter * walk.tangent.parameter > 0) scale(-1, round.tangent);
    walk.length = length;
    if (auto next = step_on(corrector, from, round, limited(corrector, round))) return next;
  }
  return {};
}

/// The next orbit, by shorter and shorter steps, then round a corner; none: no orbit closes near the last one.
std::optional<BranchPoint> next_orbit(BranchCorrector& corrector, const BranchPoint& from, Walk& walk)
{
  while (walk.length >= walk.least)
  {
    const double length = limited(corrector, walk);
    if (auto next = step_on(corrector, from, walk, length))
    {
      const double times = next->corrections <= 4 ? 1.5 : next->corrections > 7 ? 0.7 : 1;
      walk.length = std::clamp(length * times, walk.least, walk.greatest);
      return next;
    }
    walk.length = length / 2;
    if (walk.length < walk.greatest / 50) // the last step was short, and its direction perhaps that of a kink
      walk.tangent = tangent_at(corrector, from, walk.tangent);
  }
  return step_round_corner(corrector, from, walk);
}

/// Follows the branch from its start in the direction of the tangent.
BranchSide follow(BranchCorrector& corrector, const BranchPoint& start, BorderedVector tangent)
{
  const int points = corrector.settings.points;
  BranchSide side{{}, {}, known_beyond(start.multipliers)};
  side.orbits.push_back({squeal::copy_of(start.orbit), start.parameter, 0, start.multipliers, start.measures});
  refer_to(corrector, side.orbits.back());
  // The smallest step must resolve a change of contact also where the range is far wider than the value at the start.
  const double of_range = std::clamp(std::abs(start.parameter) / corrector.scales.parameter, 1e-3, 1.);
  Walk walk{std::move(tangent), 1. / points, 2e-3 / points * of_range, 6. / points};
  const bool upwards = walk.tangent.parameter > 0;
  if (!inside(corrector.settings,
              start.parameter + std::copysign(1e-9 * corrector.scales.parameter, walk.tangent.parameter)))
  {
    side.ending = BranchEnding::not_followed;
    return side;
  }
  while (static_cast<int>(side.orbits.size()) <= 8 * points)
  {
    corrector.log.done = range_passed(corrector, side, upwards);
    std::optional<BranchPoint> next = next_orbit(corrector, side.orbits.back(), walk);
    bool goes_on = next.has_value();
    if (goes_on)
    {
      refer_to(corrector, *next);
      walk.tangent = direction_between(corrector, side.orbits.back(), *next);
      examine(corrector, *next, Examined::multipliers_too);
      side.orbits.push_back(std::move(*next));
      goes_on = !went_back(corrector, side);
      if (!goes_on) side.orbits.pop_back();
    }
    if (!goes_on)
    {
      side.ending = BranchEnding::step_too_small;
      if (shrinks_to_a_point(side)) end_at_hopf(side);
      return side;
    }
    note_events(corrector, side);
    if (const auto ending = natural_end(corrector.settings, side))
    {
      side.ending = *ending;
      if (*ending == BranchEnding::small_amplitude) end_at_hopf(side);
      return side;
    }
  }
  return side;
}

/// The backward side turned round, the start, the forward side.
Branch joined(BranchSide backward, BranchSide forward)
{
  Branch branch;
  branch.ends = {backward.ending, forward.ending};
  for (std::size_t i = backward.orbits.size(); i-- > 1;) branch.points.push_back(std::move(backward.orbits[i]));
  std::ranges::move(forward.orbits, std::back_inserter(branch.points));
  std::reverse(backward.events.begin(), backward.events.end());
  for (BranchEvent& event : backward.events) event.change = -event.change;
  branch.events = std::move(backward.events);
  branch.events.insert(branch.events.end(), forward.events.begin(), forward.events.end());
  return branch;
}

/// Drops neighbouring folds that are no further apart than the residual, a part of the range, leaves the parameter
/// unknown. A branch of hardly any amplitude turns by that much.
void drop_folds_of_residuals(const ContinuationSettings& settings, std::vector<BranchEvent>& events)
{
  const double unknown = settings.tolerance * (settings.greatest - settings.least);
  for (std::size_t i = 0; i + 1 < events.size();)
  {
    const BranchEvent &event = events[i], &next = events[i + 1];
    if (event.kind == BranchEventKind::fold && next.kind == BranchEventKind::fold &&
        std::abs(event.parameter - next.parameter) <= unknown)
      events.erase(events.begin() + static_cast<std::ptrdiff_t>(i),
                   events.begin() + static_cast<std::ptrdiff_t>(i) + 2);
    else
      ++i;
  }
}

} // namespace

Branch trace_branch(const FlowFamily& family, const ContinuationSettings& settings, const ShootingOptions& options,
                    const Orbit& start, double parameter)
{
  Progress progress(comm_of(displacement(start.state)), "branch", settings.greatest - settings.least);
  ConvergenceLog log{progress, {}, 0.};
  BranchCorrector corrector{family, settings, options, log};
  corrector.scales.parameter = settings.greatest - settings.least;
  const BorderedVector rising{zeros_like(start.state), 0, corrector.scales.parameter};
  BranchPoint given{squeal::copy_of(start), parameter, 0};
  refer_to(corrector, given);
  std::optional<BranchPoint> first = correct(corrector, vector_of(given), rising);
  if (!first) return {{}, {}, {BranchEnding::step_too_small, BranchEnding::step_too_small}, log.convergence.periods};
  refer_to(corrector, *first);
  examine(corrector, *first, Examined::multipliers_too);
  BorderedVector tangent = tangent_at(corrector, *first, rising), back = copy_of(tangent);
  scale(-1, back);
  BranchSide backward = follow(corrector, *first, std::move(back));
  corrector.secants.clear();
  BranchSide forward = follow(corrector, *first, std::move(tangent));
  Branch branch = joined(std::move(backward), std::move(forward));
  drop_folds_of_residuals(settings, branch.events);
  branch.periods = log.convergence.periods;
  branch.columns = corrector.columns;
  return branch;
}

} // namespace squeal
