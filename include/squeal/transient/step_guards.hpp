#pragma once
/// When theta and the step size h would show a wrong growth (src/README.md, sections 4.10, 4.11). In sliding an
/// eigenvalue lambda is marched as
///     lambda_h = ln[(1 + (1-theta) lambda h)/(1 - theta lambda h)]/h,   Re(lambda_h) = 0 where
///     2 Re(lambda) = (2 theta - 1) h |lambda|^2:
/// - theta > 1/2 with fewer than 2 pi (theta - 1/2) |lambda|^2/(omega sigma) steps a period: what grows looks stable;
/// - theta < 1/2 with fewer than 2 pi (1/2 - theta) |lambda|^2/(omega sigma): most of the growth is the scheme's own;
/// - theta < 1/2 also amplifies every stable mode with -Re(lambda) < (1/2 - theta) h |lambda|^2, up to the highest one
///   of the mesh. No run is refused for it: the march says so, and ends where its energy is no longer finite.
/// - friction falls with the speed so steeply that a step may have several solutions. The largest eigenvalue of |mu'|
///   diag(r_n0) W_tt, at rest, is not below 1. W holds h, so that enough steps bring it below. Ramps raise mu and r_n0
///   by the largest product of their factors.
/// All refusals are lifted by StepOptions::refuse.
#include "squeal/modes/modes.hpp"
#include "squeal/transient/theta_step.hpp"

namespace squeal
{

/// ln[(1 + (1-theta) lambda h)/(1 - theta lambda h)]/h [1/s]. lambda in [1/s], h in [s]. Not collective.
std::complex<double> discrete_eigenvalue(std::complex<double> lambda, double theta, double h);

/// Why a run with this theta and h is refused, in a sentence with the remedy; empty if it is not. `mode`: the followed
/// one, or null. Not collective.
std::string step_refusal(const ComplexMode* mode, double theta, double h, const StepOptions& options);

/// The largest eigenvalue of |mu'| diag(r_n) W_tt with the steepest fall of mu; 0 where mu does not fall. A step has
/// one solution while it is below 1. Collective.
double fall_of_friction(const ThetaStep& step, const Interface& interface, const std::vector<double>& reactions);

/// Why a run is refused whose step may have several solutions, with the steps that have one; empty if it is not.
/// Factors A where mu falls. `increase`: largest factor in time on mu r_n. Collective.
std::string friction_refusal(const SlidingEquilibrium& sliding, const ComplexMode* mode, double theta, double h,
                             const StepOptions& options, double increase);

} // namespace squeal
