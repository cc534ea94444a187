#pragma once
/// The points of a sweep, in the order in which they are visited.
#include "squeal/scene/scene.hpp"

namespace squeal
{

/// Points along the number in one direction of rotation; or design points.
struct SweepLine
{
  std::vector<std::vector<double>> points; // values of the numbers
  bool reversed = false;                   // direction of rotation
  bool ordered = true;    // modes can be followed from point to point; else they are named by the first
  bool continued = false; // the first point is another group's as well: it ties the modes to its own
};

std::vector<SweepLine> lines_of(const SweepSettings& settings);

std::size_t points_of(const std::vector<SweepLine>& lines);

/// The points of one group of ranks, as evenly spread over the groups as it goes. What begins within a line begins with
/// the point before, or with the line's first one where that names the modes.
std::vector<SweepLine> share_of(const std::vector<SweepLine>& lines, int group, int groups);

} // namespace squeal
