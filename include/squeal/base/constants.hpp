#pragma once
/// Mathematical constants.
#include <numbers>

namespace squeal
{

inline constexpr double two_pi = 2 * std::numbers::pi;

} // namespace squeal
