#pragma once
/// The contact problem of one reduced step (src/README.md, section 7.4).
#include "squeal/reduction/reduced_step.hpp"

namespace squeal
{

/// The reactions after a step whose contact velocities are b without them; `contact` is of the step before. The
/// residual is that of section 4.6. Returns whether it converged.
bool solve_contact(const ReducedMap& map, const Eigen::VectorXd& b, ReducedContact& contact);

} // namespace squeal
