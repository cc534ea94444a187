#pragma once
/// An approximate inverse of dPhi_T/dx - I from a reduced model on recorded contact (src/README.md, section 7.6).
#include "squeal/cycle/limit_cycle.hpp"

#include <memory>

namespace squeal
{

/// The preconditioner from the contact of the period that the map has recorded last when it is asked for first. None
/// where no reduced model can be made. `kept`: that model, once it is made, which is then the problem's as well.
/// Borrows all.
Preconditioner recorded_preconditioner(CycleProblem& problem, PeriodMap& map,
                                       std::shared_ptr<const ReducedModel>& kept);

/// Real modes beyond the complex ones, up to a frequency [Hz]. None where the complex ones reach to within a tenth of
/// it: the end of a band is no sharp bound of what matters, and to seek in so short a band costs two factors.
RealModes real_modes_beyond(const CycleProblem& problem, double highest);

} // namespace squeal
