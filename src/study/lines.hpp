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
  bool known = false;                      // the first point is another group's as well: it ties the modes to its own
};

std::vector<SweepLine> lines_of(const SweepSettings& settings);

std::size_t points_of(const std::vector<SweepLine>& lines);

/// So many points, one after the other, as evenly spread over groups of ranks as it goes. What begins within a line
/// begins with the point before; where a line begins in it, the first points of the last lines before in either
/// direction of rotation come first.
std::vector<SweepLine> share_of(const std::vector<SweepLine>& lines, int group, int groups);

} // namespace squeal
