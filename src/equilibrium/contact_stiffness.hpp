#pragma once
/// Pairs with a compliance in the linearised sliding problem (src/README.md, section 3.13).
#include "squeal/contact/interface.hpp"

namespace squeal
{

/// Rows -B_n/c of the closed pairs with a compliance, which give their reactions; null without such pairs.
Owned<Mat> compliant_reactions(const Interface& interface, const std::vector<char>& closed);

} // namespace squeal
