#pragma once
/// Floquet multipliers of a brake's cycle (src/README.md, section 6.9). The approximate right and left vectors that the
/// oblique projection needs come from a reduced model on the contact of one recorded period of the full one.
#include "squeal/cycle/limit_cycle.hpp"

namespace squeal
{

/// Gives the flow the slow motions of the map. Errors hold what `other_steps` steps a period change; 0: none are
/// compared. Borrows problem, options and map.
void add_slow_motions(const CycleProblem& problem, PeriodMap& map, int other_steps, Flow& flow);

/// The number of steps a period that tells the error of another: twice as many of few where periods are dear and no
/// verdict at finer steps follows, else 0. Collective.
int steps_to_compare(const Structure& structure, int steps);

/// The number of steps a period at which an orbit is judged: its own, or enough_steps where as many are dear.
/// Collective.
int steps_of_verdict(const Structure& structure, int steps);

/// The verdict on a converged cycle, by at most 128 steps a period: what the others change is in the bars.
Verdict examine(const CycleProblem& problem, const CycleOptions& options, const LimitCycle& cycle);

} // namespace squeal
