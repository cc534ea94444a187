#pragma once
/// Floquet multipliers of a brake's cycle (src/README.md, section 6.9). The oblique projection needs approximate right
/// and left vectors. They come from a reduced model on the contact of one recorded period of the full one.
#include "squeal/cycle/limit_cycle.hpp"

#include <memory>

namespace squeal
{

/// A second recording, by whose change the first one's error is told: its steps a period, and the part of the change.
struct OtherSteps
{
  int steps = 0; // 0: none is made
  double part = 0;
};

/// The reduced model for recorded periods, the problem's own where it holds them; null where none fits the free memory,
/// with the reason. Error: as of reduce.
std::shared_ptr<const ReducedModel>
recorded_model(const CycleProblem& problem, std::span<const std::vector<StepRecord>> periods, std::string& missing);

/// Gives the flow the slow motions of the map. Errors hold what these other steps change. Borrows problem and map.
void add_slow_motions(const CycleProblem& problem, PeriodMap& map, const OtherSteps& other, Flow& flow);

/// Twice as many and one more, which place each event at other points of its step. Contact that hits or sticks has an
/// error of first order. Where periods are dear, twice as many of few, by a step's order 2, or none. Collective.
OtherSteps steps_to_compare(const Structure& structure, int steps);

/// The number of steps a period at which an orbit is judged: its own, or enough_steps where as many are dear.
/// Collective.
int steps_of_verdict(const Structure& structure, int steps);

/// The verdict on a converged cycle, by at most 128 steps a period: what the others change is in the bars.
Verdict examine(const CycleProblem& problem, const CycleOptions& options, const LimitCycle& cycle);

// An approximate inverse of dPhi_T/dx - I from a reduced model on recorded contact (src/README.md, section 7.6).

/// The preconditioner from the contact of the period that the map has recorded last when it is asked for first. None
/// where no reduced model can be made; that model becomes the problem's. Borrows both.
Preconditioner recorded_preconditioner(CycleProblem& problem, PeriodMap& map);

/// Real modes beyond the complex ones, up to a frequency [Hz]. None where the complex ones reach to within a tenth of
/// it. The end of a band is no sharp bound of what matters, and a search in so short a band costs two factors.
RealModes real_modes_beyond(const CycleProblem& problem, double highest);

} // namespace squeal
