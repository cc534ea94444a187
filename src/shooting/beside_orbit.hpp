#pragma once
/// Motions that begin beside an orbit, and what their distance from it does (src/README.md, section 6.9). Collective.
#include "squeal/shooting/multipliers.hpp"

namespace squeal
{

/// A state displaced from the orbit by a part of its fluctuation along its fastest motion. `part`: positive towards
/// less energy.
Owned<Vec> state_beside(const OrbitProblem& problem, const Orbit& orbit, Vec fastest, double part);

/// A motion beside an orbit, as parts of its fluctuation.
struct BesideMotion
{
  double first = 0;               // where the motion begins
  double lowest = 0, highest = 0; // where it has been seen long enough
  long periods = 0;               // at most
};

/// Distances from the orbit at the ends of periods, without their part along the flow. Where the tangent holds they are
/// multiplied by |m| in every period, of a complex multiplier m too.
std::vector<double> distances_beside(const OrbitProblem& problem, ConvergenceLog& log, const Orbit& orbit,
                                     const FastestMotion& fastest, const BesideMotion& motion);

/// What the distance of a motion from the orbit grows by, from smaller and smaller parts of the fluctuation until that
/// is what the largest multiplier says. The largest part comes first.
std::vector<SeenGrowth> growths_beside(const OrbitProblem& problem, ConvergenceLog& log, const Orbit& orbit,
                                       const FloquetAnalysis& floquet, long periods);

/// Whether the bar of the largest multiplier, or of its conjugate, alone leaves the verdict open. Not collective.
bool is_left_open_by_largest(const Multipliers& multipliers);

/// Decides what only the bar of the largest multiplier leaves undecided, where a motion along it was seen to grow or to
/// decay beyond its own bar. "Stable" is undecided where one was seen to grow.
void decide_by_growth(const std::vector<SeenGrowth>& seen, Multipliers& multipliers);

} // namespace squeal
