#pragma once
/// How far a cycle's period and energy spread over the offsets that its joints may keep (src/README.md, section 6.13).
#include "squeal/cycle/period_map.hpp"
#include "squeal/shooting/secants.hpp"

namespace squeal
{

/// A cycle on its map, and what another one is found by.
struct CycleAtOffsets
{
  PeriodMap& map;
  const OrbitProblem& problem;
  const ShootingOptions& options;
  ConvergenceLog& log;
  const Orbit& orbit;
  const MeasuredPeriod& measured;
};

/// Moves the held pairs of each contact along each tangent, all of them alike, and shoots at the cycle there. The range
/// ends where the first of the pairs reaches its friction, by a line. Collective.
std::vector<OffsetSpread> spread_over_offsets(const CycleAtOffsets& at);

} // namespace squeal
