#pragma once
/// Random numbers that are the same on every machine.
#include <random>

namespace squeal
{

/// A number in [0, 1). The distributions of the standard library differ from one implementation to another.
inline double uniform(std::mt19937_64& generator)
{
  return static_cast<double>(generator() >> 11) * 0x1p-53;
}

} // namespace squeal
