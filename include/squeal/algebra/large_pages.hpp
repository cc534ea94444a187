#pragma once
/// Arrays on pages of 2 MB, where Linux has them, for what every step reads from end to end. The processor does not
/// prefetch beyond a page: with pages of 4 kB reading takes half as long again. Such pages are cleared when they are
/// first touched, which does not pay for short-lived arrays.
#include <vector>

namespace squeal
{

/// An empty vector with room for `count` numbers on large pages.
std::vector<double> vector_on_large_pages(std::size_t count);

} // namespace squeal
