#pragma once
/// An approximate inverse of dPhi_T/dx - I from sliding motion: P^-1 x = -x + E D E^+ x (src/README.md, section 6.6).
///
/// The bulk of the period map is linear and known. A state outside the span of the modes' shapes Phi is taken as damped
/// out within a period (dPhi/dx = 0, inverse -1); inside it motion is sliding about equilibrium,
///     u = u0 + Phi q,   Mc q'' + Cc q' + Kc q = 0,
///     Xc = Phi'X Phi - mu (e.B_t Phi)' L X Phi   for X = M, C + C_f, K;   L: reactions lambda_n of a force,
/// with friction on the reactions that the motion takes. N theta steps multiply its eigenvectors (y, lambda y) by
///     m = [(1 + (1-theta) lambda h)/(1 - theta lambda h)]^N,   D: 1/(m - 1) + 1.
/// At the cycle the unstable pair has become {1, a contraction}. It is taken to decay at three times the rate of its
/// growth, the followed one in step with the cycle. Near the onset of the instability, where the square of the
/// amplitude limits the growth, the rate is twice; too slow a decay makes the steps too long.
#include "squeal/cycle/limit_cycle.hpp"

namespace squeal
{

/// On the shapes of the modes up to a multiple of the followed mode's frequency, and on those of real modes where the
/// band ends far below that; none for a factor of 0. Borrows the structure's M.
Preconditioner estimated_preconditioner(const CycleProblem& problem, double band_factor);

/// Real modes beyond the complex ones, up to a frequency [Hz]. None where the complex ones reach to within a tenth of
/// it: the end of a band is no sharp bound of what matters, and to seek in so short a band costs two factors.
RealModes real_modes_beyond(const CycleProblem& problem, double highest);

} // namespace squeal
