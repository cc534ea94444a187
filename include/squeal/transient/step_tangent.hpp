#pragma once
/// The exact tangent of theta steps along a recorded motion (src/README.md, section 4.13).
///
/// Statuses, friction directions and reactions are those of the record, so that a step is a linear map without contact
/// iterations. Columns share each reading of the factor, of M, K and of W.
///
/// Caveat: the step is piecewise smooth. The tangent does not see a change of the start that changes a status.
#include "squeal/transient/theta_step.hpp"

namespace squeal
{

/// A change of the state and its causes besides the change of the start.
struct TangentColumn
{
  Owned<Vec> u, v;      // du [m], dv [m/s]
  double step_size = 0; // [s] dh of every step; the records then need their rates
  double friction = 0;  // change of the friction law's coefficient in every step
};

/// The records of `steps` steps made in place. Collective. The state becomes that at their end.
std::vector<StepRecord> record_steps(const ThetaStep& step, const Structure& structure, const Interface& interface,
                                     State& state, int steps, Recorded wanted);

/// From changes at the start of the recorded steps to those at their end, in place. Collective.
void advance_tangents(const ThetaStep& step, const Structure& structure, const Interface& interface,
                      std::span<const StepRecord> records, std::span<TangentColumn> columns);

} // namespace squeal
