#pragma once
/// M, C and K in the form that every later stage relies on.
#include "squeal/solid/structure.hpp"

namespace squeal
{

/// Gives M, C and K the union of their patterns (with the whole diagonal), so that A = M + a C + b K is a plain sum of
/// values, and marks them symmetric.
void share_pattern(Structure& structure);

/// Tells the library that A is symmetric for good, and that its pattern is complete.
void mark_symmetric(Mat A);

} // namespace squeal
