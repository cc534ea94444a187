#pragma once
/// Floquet multipliers of a brake's cycle (src/README.md, section 6.9). The approximate right and left vectors that the
/// oblique projection needs come from a reduced model on the contact of one recorded period of the full one.
#include "squeal/cycle/limit_cycle.hpp"

namespace squeal
{

/// Gives the flow the slow motions of the map. Borrows all three.
void add_slow_motions(const CycleProblem& problem, PeriodMap& map, Flow& flow);

/// Of a converged cycle of the map.
FloquetAnalysis examine(const CycleProblem& problem, const ShootingOptions& options, PeriodMap& map,
                        const Orbit& orbit);

} // namespace squeal
