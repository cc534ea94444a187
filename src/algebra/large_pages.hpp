#pragma once
/// Pages of 2 MB, where Linux has them, for arrays that every step reads from end to end: with pages of 4 kB, which the
/// processor does not read ahead beyond, that takes half as long again. Not for what lives shortly: to clear them
/// costs.
#include <vector>

namespace squeal
{

/// An empty vector with room for `count` numbers on large pages.
std::vector<double> on_large_pages(std::size_t count);

} // namespace squeal
