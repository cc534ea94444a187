#pragma once
/// An approximate inverse of dPhi_T/dx - I from a reduced model on recorded contact (src/README.md, section 7.6).
#include "squeal/cycle/limit_cycle.hpp"

namespace squeal
{

/// The preconditioner from the contact of the period that the map has recorded last when it is asked for first. None
/// where no reduced model can be made; that model becomes the problem's. Borrows both.
Preconditioner recorded_preconditioner(CycleProblem& problem, PeriodMap& map);

/// Real modes beyond the complex ones, up to a frequency [Hz]. None where the complex ones reach to within a tenth of
/// it: the end of a band is no sharp bound of what matters, and to seek in so short a band costs two factors.
RealModes real_modes_beyond(const CycleProblem& problem, double highest);

} // namespace squeal
