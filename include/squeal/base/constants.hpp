#pragma once
/// Constants of computing.
#include <numbers>

namespace squeal
{

inline constexpr double two_pi = 2 * std::numbers::pi;

/// Numbers of an input beyond this size are refused: third powers of them would not be finite.
inline constexpr double largest_number = 1e100;

/// Degrees of freedom up to which the whole tangent over a period is formed: its columns cost a few periods.
inline constexpr int small_model = 50;

/// Degrees of freedom beyond which a period and a mode cost so much that columns, free periods, steps a period, real
/// modes and digits of a sweep are spared.
inline constexpr int large_model = 10000;

} // namespace squeal
