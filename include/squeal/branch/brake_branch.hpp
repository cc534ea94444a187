#pragma once
/// The branch of a brake's limit cycle along a number of its scene (src/README.md, section 9).
///
/// States are absolute, so that a change of the parameter changes the step alone.
#include "squeal/branch/continuation.hpp"
#include "squeal/cycle/limit_cycle.hpp"

namespace squeal
{

/// outcome: "converged" (both sides came to a bound, to first lift-off or to a Hopf point), "not converged" (how far
/// they came), "skipped", "off".
struct BrakeBranch
{
  Outcome outcome;
  Branch branch;
};

/// The cycle that is followed, the number that changes, and how each point is computed.
struct BrakeBranchProblem
{
  const BranchSettings& settings;
  std::function<Model(double parameter)> model_at; // with matrices of the layout of the scene's own
  CycleProblem own;                                // of the scene itself
  const LimitCycle& cycle;                         // where the branch starts
  int steps_per_period = 0;
  double tolerance = 0; // on the full-space residual
  const EquilibriumOptions& equilibrium_options;
  const ShootingOptions& shooting;
};

/// Why no branch can start from the cycle; empty if it can. `tolerance`: of the residual. [-] Not collective.
std::string no_cycle_to_follow(const LimitCycle& cycle, double tolerance);

/// The number of steps a period along a branch: the scene's, else that of the cycle it starts from. It is at most 128,
/// since every point takes several periods. Not collective.
int steps_along_branch(const CycleSettings& settings, const LimitCycle& cycle);

/// Follows the cycle both ways from the scene's own value to the ends of the range. Collective. Error: a value of the
/// parameter makes no scene.
BrakeBranch find_branch(const BrakeBranchProblem& problem);

} // namespace squeal
