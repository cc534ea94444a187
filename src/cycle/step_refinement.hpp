#pragma once
/// Cycles of the full model near one that is known, at as many steps a period as the accuracy needs (src/README.md,
/// section 7.8).
#include "squeal/cycle/fidelity.hpp"

namespace squeal
{

/// Takes a converged cycle to twice as many steps a period; where these are still too few, to as many as the errors of
/// both foretell. Where the accuracy is not reached, the finest cycle stands with its errors, and its reason says so.
/// Where the run is asked to end meanwhile, the cycle that was found stays.
void refine_steps(CycleProblem& problem, const CycleOptions& options, FittedCycle& found);

/// A cycle at some number of steps a period.
struct CycleAtSteps
{
  int steps = 0;
  double period = 0, energy = 0; // [s], [J]
};

/// Errors of the last of two cycles, of first order, or of the last of more, of the order that all of them show.
RelativeChange step_errors_of(const std::vector<CycleAtSteps>& cycles);

} // namespace squeal
