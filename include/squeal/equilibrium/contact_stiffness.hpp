#pragma once
/// Pairs with a compliance in the linearised sliding problem (src/README.md, section 3.13).
#include "squeal/equilibrium/linearised_sliding.hpp"

namespace squeal
{

/// S of the closed pairs with a compliance c, on the rows of B: contact_stiffness is B'S B. It has 1/c and, from normal
/// to tangential rows, mu e/c; of elastic slip 1/c_t in tangential rows. Null without such pairs. Collective.
Owned<Mat> stiffness_of_pairs(const Interface& interface, const std::vector<char>& closed, PairForces part);

/// Rows -B_n/c of the closed pairs with a compliance, which give their reactions; null without such pairs.
Owned<Mat> compliant_reactions(const Interface& interface, const std::vector<char>& closed);

} // namespace squeal
