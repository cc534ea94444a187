#pragma once
/// The full model's cycle from the reduced one's: secants on the full model's periods, and as many steps a period as
/// the accuracy needs (src/README.md, section 7.8).
#include "reduced_cycle.hpp"

namespace squeal
{

/// Corrects the reduced model's cycle as far as the fidelity asked for says, and estimates the errors that remain.
/// Returns why the accuracy was not reached, or nothing.
std::string correct_on_full_model(ReducedSearch& search, const ShootingStart& start,
                                  const Preconditioner& preconditioner, const ReducedCycle& reduced,
                                  LimitCycle& result);

} // namespace squeal
