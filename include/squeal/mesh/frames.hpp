#pragma once
/// Axes of local frames.
#include "squeal/scene/model_parts.hpp"

namespace squeal
{

/// The axes 1, 2 and 3 of a frame at a place. Throws Error for one on the axis of a cylinder; `user` says
/// whose frame it is.
std::array<Vec3, 3> axes_at(const Frame& frame, const Vec3& place, const std::string& user);

} // namespace squeal
