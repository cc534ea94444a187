#pragma once
/// Which sliding velocity friction opposes in a step of the theta method (src/README.md, section 4.3):
///     w_t = s+ + past,   past = (1-theta)/theta s,   so that w_t = s_theta/theta,
/// s the sliding velocity at the step's start and s+ at its end. The past sliding is left out where friction opposes
/// s+. These pairs stuck in the step before, so that s is rounding, or are closed and have s+.s < 0 at the solution.
/// Those would stop or turn back, which friction does not do by itself, and s_theta = 0 is not rest. Arithmetic on
/// contact vectors of one rank.
#include "squeal/contact/pair_law.hpp"

namespace squeal
{

/// A contact vector with `weight` s on the tangential rows of the pairs that did not stick, and zeros elsewhere.
/// `velocity`: B v of the step's start; `weight`: (1-theta)/theta.
std::vector<double> past_sliding(PairView<const double> velocity, TangentView<const double> drive,
                                 const std::vector<ContactStatus>& status, double weight);

/// Sets `past` to zero on closed pairs of the solution r whose s+ = w_t - past points against it. Returns whether there
/// were any: contact is then to be solved again.
bool leave_out_where_turned(PairView<const double> r, PairView<const double> w, PairView<double> past);

/// Whether friction of the pair opposes s+.
bool opposes_end(PairView<const double> past, std::size_t pair);

} // namespace squeal
