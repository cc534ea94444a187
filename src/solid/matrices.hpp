#pragma once
/// Properties of M, C and K that every later stage relies on.
#include "squeal/solid/structure.hpp"

namespace squeal
{

/// Gives M, C and K the union of their patterns with the whole diagonal, and marks them as symmetric.
/// A sum M + a C + b K then needs additions of values only.
void share_pattern(Structure& structure);

} // namespace squeal
