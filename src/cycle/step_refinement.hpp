#pragma once
/// Cycles of the full model near one that is known (src/README.md, section 7.8). They have as many steps a period as
/// the accuracy needs, or one period shows how far another model's cycle is off.
#include "squeal/cycle/fidelity.hpp"

namespace squeal
{

/// What corrections of a cycle need. The preconditioner decides how soon they end, not where.
struct CycleCorrection
{
  const CycleProblem& problem;
  const CycleOptions& options;
  const Preconditioner& preconditioner;
  Fidelity& fidelity; // gains the errors and the periods
};

/// Takes a converged cycle to twice as many steps a period; where these are still too few, to as many as the errors of
/// both foretell. Where the accuracy is not reached, the finest cycle stands with its errors, and `fidelity.reason`
/// says so.
void refine_steps(const CycleCorrection& correction, LimitCycle& cycle);

/// The errors of a converged cycle whose steps are given: what one further step of the iteration would change.
void estimate_model_errors(const CycleCorrection& correction, const LimitCycle& cycle);

/// One period of the full model from the cycle of another, which gives that one's errors.
LimitCycle measure_reduced_cycle(const CycleCorrection& correction, const ShootingStart& start);

/// A cycle at some number of steps a period.
struct CycleAtSteps
{
  int steps = 0;
  double period = 0, energy = 0; // [s], [J]
};

/// Errors of the last of two cycles, of first order, or of the last of three and more, of both orders.
void estimate_step_errors(Fidelity& fidelity, const std::vector<CycleAtSteps>& cycles);

} // namespace squeal
