#pragma once
/// What residuals of contact are compared with (src/README.md, section 4.6). Arithmetic of one rank.
#include "squeal/contact/pair_law.hpp"

#include <algorithm>

namespace squeal
{

/// The force that a pair's natural map is compared with [N]: the largest reaction, of its contact or of all, or where
/// it is smaller the force that would give the pair the largest free velocity `speed`. A light pair beside heavy ones
/// is then not passed over.
inline double force_scale(const NaturalScale& rho, double speed, double largest_reaction)
{
  const double own = speed * std::min(rho.normal, rho.tangential);
  return own == 0 ? largest_reaction : largest_reaction == 0 ? own : std::min(own, largest_reaction);
}

} // namespace squeal
