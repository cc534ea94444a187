#pragma once
/// Motions that begin beside an orbit, and what their distance from it does (src/README.md, section 6.9). Collective.
#include "squeal/shooting/multipliers.hpp"
#include "squeal/shooting/orbit.hpp"

namespace squeal
{

/// A state displaced from the orbit by a part of its fluctuation along its fastest motion. `part`: positive towards
/// less energy.
Owned<Vec> state_beside(const OrbitProblem& problem, const Orbit& orbit, Vec fastest, double part);

/// What the distance of a motion from the orbit grows by, from smaller and smaller parts of the fluctuation until that
/// is what the deciding multiplier says; of an unstable orbit from one part alone. The largest part comes first.
std::vector<SeenGrowth> growths_beside(const OrbitProblem& problem, ConvergenceLog& log, const Orbit& orbit,
                                       const FloquetAnalysis& floquet, long periods);

/// Whether the bar of the deciding multiplier, or of its conjugate, alone leaves the verdict open. Not collective.
bool is_left_open_by_one(const Multipliers& multipliers);

/// Decides what is undecided where a motion was seen to grow beyond its own bar, and what only the bar of one
/// multiplier leaves undecided where it was seen to decay. "Stable" is undecided where one was not seen to decay, and
/// "unstable" where it was not: where contact only just opens, closes or sticks, the tangent holds in a neighbourhood
/// that no motion stays in.
void decide_by_growth(const std::vector<SeenGrowth>& seen, Multipliers& multipliers);

} // namespace squeal
