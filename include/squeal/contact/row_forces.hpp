#pragma once
/// Forces on rows of the pairs by what they do to the structure.
#include "squeal/contact/interface.hpp"

namespace squeal
{

/// z with B'z nearest to x, on the rows that are taken (of as many entries as a contact vector), 0 on others.
/// Conjugate gradients on B B': pairs that share no node are independent of each other. Collective.
std::vector<double> forces_on_rows(const Interface& interface, const std::vector<char>& taken, Vec x);

} // namespace squeal
