#pragma once
/// Axes of local frames.
#include "squeal/scene/model_parts.hpp"

#include <Eigen/Core>

namespace squeal
{

/// Columns: the axes 1, 2 and 3 of a frame at a place. Throws Error for one on the axis of a cylinder; `user` says
/// whose frame it is.
Eigen::Matrix3d axes_at(const Frame& frame, const Vec3& place, const std::string& user);

/// Twice the same axes, on translations and rotations.
Eigen::Matrix<double, 6, 6> twice(const Eigen::Matrix3d& axes);

} // namespace squeal
