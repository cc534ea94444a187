#pragma once
/// Constants of computing.
#include <numbers>

namespace squeal
{

inline constexpr double two_pi = 2 * std::numbers::pi;

/// Numbers of an input beyond this size are refused: third powers of them would not be finite.
inline constexpr double largest_number = 1e100;

} // namespace squeal
