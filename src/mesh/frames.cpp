#include "squeal/mesh/frames.hpp"

#include "squeal/base/error.hpp"

#include <algorithm>

namespace squeal
{

Eigen::Matrix3d axes_at(const Frame& frame, const Vec3& place, const std::string& user)
{
  Vec3 first = frame.axis_1, second = frame.axis_2;
  if (frame.cylinder)
  {
    constexpr double rounding = 1e-9; // of the distances to the origin
    const auto& [axis, centre] = *frame.cylinder;
    const Vec3 arm = place - centre, radius = arm - dot(arm, axis) * axis;
    if (norm(radius) <= rounding * std::max(norm(place), norm(centre)))
      throw Error(user + format(": (%g, %g, %g) is on the axis of its cylinder, where no direction is radial: leave it "
                                "out of the group, or move the axis",
                                place[0], place[1], place[2]));
    first = (1 / norm(radius)) * radius;
    second = cross(axis, first);
  }
  const Vec3 third = cross(first, second);
  Eigen::Matrix3d axes;
  for (int c = 0; c < 3; ++c)
  {
    const auto i = static_cast<std::size_t>(c);
    axes.row(c) << first[i], second[i], third[i];
  }
  return axes;
}

Eigen::Matrix<double, 6, 6> twice(const Eigen::Matrix3d& axes)
{
  Eigen::Matrix<double, 6, 6> both = Eigen::Matrix<double, 6, 6>::Zero();
  both.topLeftCorner<3, 3>() = axes;
  both.bottomRightCorner<3, 3>() = axes;
  return both;
}

} // namespace squeal
