#pragma once
/// Contact within a theta step (src/README.md, sections 4.3 to 4.7).
#include "squeal/transient/theta_step.hpp"

namespace squeal
{

/// A step of a trajectory.
struct OneStep
{
  const ThetaStep& step;
  const Interface& interface;
  const StepFactors& factors;
  StepWork& work;
  State& state;
  StepReport& report;
};

/// The laws with the coefficients of driven pairs times a factor. Joints keep theirs, which hold the structure
/// together.
PairFriction scaled(const Interface& interface, double factor);

/// Statuses of a step's end, from its reactions, its law, its factor on the drive and `velocity`, B v. A law without a
/// decay speed does not look at the last.
std::vector<ContactStatus> status_with(const Interface& interface, const PairFriction& friction, double drive,
                                       const std::vector<double>& reactions, std::vector<double> velocity);

/// Reactions at the end of the step, into the state of every rank, and what the report says of contact. `Bv_free`: B v
/// of the step without reactions, on rank 0. Overwrites v_theta. Collective.
void find_reactions(const OneStep& one, std::vector<double> Bv_free);

} // namespace squeal
