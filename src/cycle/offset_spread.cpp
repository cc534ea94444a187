#include "offset_spread.hpp"

#include <algorithm>
#include <limits>

namespace squeal
{

namespace
{

/// The pairs that are moved, along one tangent of theirs.
struct MovedPairs
{
  std::vector<std::size_t> pairs;
  int contact = 0, direction = 0;
};

/// The held pairs of each contact, along each tangent.
std::vector<MovedPairs> movable(const Interface& interface, const std::vector<char>& held)
{
  std::vector<MovedPairs> all;
  for (std::size_t i = 0; i < held.size(); ++i)
    for (int k = 0; held[i] && k < interface.directions; ++k)
    {
      const auto contact = static_cast<int>(interface.friction.contact_of(i));
      const auto known = std::ranges::find_if(all, [&](const MovedPairs& one)
                                              { return one.contact == contact && one.direction == k; });
      (known == all.end() ? all.emplace_back(MovedPairs{{}, contact, k}) : *known).pairs.push_back(i);
    }
  return all;
}

/// Moves the end of a range to where the use of a pair's friction comes to `limit`, as it rises from here to there.
void shorten(double limit, double here, double there, double step, OffsetSpread& spread)
{
  const double slope = (there - here) / step;
  if (slope == 0) return;
  const double end = (limit - here) / slope;
  if (end >= 0)
    spread.greatest = std::min(spread.greatest, end);
  else
    spread.least = std::max(spread.least, end);
}

/// The spread from one cycle to another, `step` [m] apart.
OffsetSpread spread_between(const CycleAtOffsets& at, const Orbit& other, const MeasuredPeriod& there, double step)
{
  constexpr double unbounded = std::numeric_limits<double>::infinity();
  OffsetSpread spread{0, 0, -unbounded, unbounded};
  const JointUse &here = at.measured.joints, &use = there.joints;
  for (std::size_t i = 0; i < here.least.size(); ++i)
  {
    if (here.slipped[i / static_cast<std::size_t>(at.map.sliding.interface.directions)]) continue;
    shorten(1, here.greatest[i], use.greatest[i], step, spread);
    shorten(-1, here.least[i], use.least[i], step, spread);
  }
  spread.by_period = (other.period - at.orbit.period) / step;
  spread.by_energy = (there.mean_fluctuating_energy - at.measured.mean_fluctuating_energy) / step;
  return spread;
}

} // namespace

std::vector<OffsetSpread> spread_over_offsets(const CycleAtOffsets& at)
{
  constexpr double part = 0.01; // of the swing
  PeriodMap& map = at.map;
  const JointMotion motion = map.joints;
  const double step = part * motion.slip.swing;
  std::vector<OffsetSpread> spreads;
  for (const MovedPairs& moved : movable(map.sliding.interface, motion.held))
  {
    std::vector<double> offsets = motion.offsets;
    for (const std::size_t pair : moved.pairs)
      PairView<double>(offsets, map.sliding.interface.directions)
          .tangential(pair)[static_cast<std::size_t>(moved.direction)] += step;
    const Equilibrium rest = map.rest.at(map.sliding, map.options.factor, motion.offsets),
                      other = map.rest.at(map.sliding, map.options.factor, offsets);
    if (rest.outcome.kind != OutcomeKind::converged || other.outcome.kind != OutcomeKind::converged) continue;
    const Owned<Vec> start = copy_of(at.orbit.state.get());
    check(VecAXPBYPCZ(displacement(start), 1, -1, 1, other.u, rest.u));
    const StageResult found =
        shoot_once(at.problem, at.options, at.log, evaluate(at.problem, at.log, start, at.orbit.period));
    if (found.ending != StageEnding::converged || found.orbit.offsets.held != at.orbit.offsets.held) continue;
    const MeasuredPeriod there = measure_period(map, {}, found.orbit.period, found.orbit.state, nullptr);
    spreads.push_back(spread_between(at, found.orbit, there, step));
    spreads.back().contact = moved.contact;
    spreads.back().direction = moved.direction;
  }
  return spreads;
}

} // namespace squeal
