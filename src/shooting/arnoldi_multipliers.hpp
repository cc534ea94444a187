#pragma once
/// Multipliers from an Arnoldi space of the monodromy matrix, in the energy product (src/README.md, section 6.9).
#include "monodromy.hpp"

namespace squeal
{

/// From an Arnoldi space of `steps` columns at most; where `steps` is negative, at most -`steps` until the largest
/// value has converged. Bars: twice the residual of each Ritz pair and what other grids of time change the largest by.
FloquetAnalysis multipliers_by_arnoldi(const Monodromy& monodromy, Owned<Vec> start, PetscInt steps);

} // namespace squeal
