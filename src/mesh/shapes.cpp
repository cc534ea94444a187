#include "squeal/mesh/shapes.hpp"

#include <algorithm>

namespace squeal
{

int node_count(Shape shape)
{
  return corner_count(shape) + static_cast<int>(mid_sides(shape).size());
}

int node_count(FaceShape shape)
{
  switch (shape)
  {
  case FaceShape::triangle3:
    return 3;
  case FaceShape::quad4:
    return 4;
  case FaceShape::triangle6:
    return 6;
  case FaceShape::quad8:
    return 8;
  case FaceShape::quad9:
    return 9;
  }
  return 0;
}

bool is_shell(Shape shape)
{
  return shape == Shape::shell4 || shape == Shape::shell3;
}

int corner_count(Shape shape)
{
  switch (shape)
  {
  case Shape::hex8:
  case Shape::hex20:
    return 8;
  case Shape::wedge6:
    return 6;
  case Shape::tet10:
  case Shape::shell4:
    return 4;
  case Shape::shell3:
    return 3;
  }
  return 0;
}

int corner_count(FaceShape shape)
{
  return shape == FaceShape::triangle3 || shape == FaceShape::triangle6 ? 3 : 4;
}

std::span<const std::array<int, 2>> mid_sides(Shape shape)
{
  static constexpr std::array<int, 2> hex[] = {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3},
                                               {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7}};
  static constexpr std::array<int, 2> tet[] = {{0, 1}, {1, 2}, {2, 0}, {3, 0}, {3, 2}, {3, 1}};
  if (shape == Shape::hex20) return hex;
  if (shape == Shape::tet10) return tet;
  return {};
}

std::span<const std::array<int, 4>> corner_faces(Shape shape)
{
  static constexpr std::array<int, 4> hex[] = {{0, 3, 2, 1}, {0, 1, 5, 4}, {0, 4, 7, 3},
                                               {1, 2, 6, 5}, {2, 3, 7, 6}, {4, 5, 6, 7}};
  static constexpr std::array<int, 4> wedge[] = {
      {0, 2, 1, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {0, 3, 5, 2}, {1, 2, 5, 4}};
  static constexpr std::array<int, 4> tet[] = {{0, 2, 1, -1}, {0, 1, 3, -1}, {0, 3, 2, -1}, {3, 1, 2, -1}};
  switch (shape)
  {
  case Shape::hex8:
  case Shape::hex20:
    return hex;
  case Shape::wedge6:
    return wedge;
  case Shape::tet10:
    return tet;
  default:
    return {};
  }
}

std::vector<int> mirrored_order(Shape shape)
{
  std::vector<int> order;
  switch (shape)
  {
  case Shape::hex8:
  case Shape::hex20:
    order = {0, 3, 2, 1, 4, 7, 6, 5};
    break;
  case Shape::wedge6:
    order = {0, 2, 1, 3, 5, 4};
    break;
  case Shape::tet10:
    order = {0, 2, 1, 3};
    break;
  case Shape::shell4:
    order = {0, 3, 2, 1};
    break;
  case Shape::shell3:
    order = {0, 2, 1};
    break;
  }
  const std::vector<int> corners = order;
  const auto sides = mid_sides(shape);
  for (const auto& [a, b] : sides)
  {
    const int from = corners[a], to = corners[b];
    const auto side =
        std::find_if(sides.begin(), sides.end(),
                     [&](const auto& s) { return (s[0] == from && s[1] == to) || (s[0] == to && s[1] == from); });
    order.push_back(corner_count(shape) + static_cast<int>(side - sides.begin()));
  }
  return order;
}

std::vector<int> mirrored_order(FaceShape shape)
{
  switch (shape)
  {
  case FaceShape::triangle3:
    return {0, 2, 1};
  case FaceShape::quad4:
    return {0, 3, 2, 1};
  case FaceShape::triangle6:
    return {0, 2, 1, 5, 4, 3};
  case FaceShape::quad8:
    return {0, 3, 2, 1, 7, 6, 5, 4};
  case FaceShape::quad9:
    return {0, 3, 2, 1, 7, 6, 5, 4, 8};
  }
  return {};
}

} // namespace squeal
