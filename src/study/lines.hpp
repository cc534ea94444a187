#pragma once
/// The points of a sweep, in the order in which they are visited.
#include "squeal/scene/scene.hpp"

namespace squeal
{

/// Points along the first number, with the second one and the direction of rotation held; or random points.
struct SweepLine
{
  std::vector<std::vector<double>> points; // values of the numbers
  bool reversed = false;                   // direction of rotation
  bool ordered = true;                     // modes can be followed from point to point
};

std::vector<SweepLine> lines_of(const SweepSettings& settings);

} // namespace squeal
