#pragma once
/// Where modes become unstable or stable between two points (src/README.md, section 10.5).
#include "following.hpp"
#include "squeal/study/sweep.hpp"

#include <functional>

namespace squeal
{

/// What a search between two points needs.
struct ThresholdSearch
{
  std::function<std::optional<Followed>(double value)> point_at; // of the first number; nothing where it fails
  std::function<std::vector<Match>(const Followed& from, const Followed& to)> follow;
  double band = 0;      // [Hz]
  double tolerance = 0; // of the first number
  int& tracks;          // number so far
};

/// All that show between two points, each with points on both sides within the tolerance, whose numbers of unstable
/// modes differ there. A point that fails ends the search with the brackets known. Sets the tracks of the second point
/// by the points on the way; -1: unclear. Collective.
std::vector<Threshold> find_thresholds(const ThresholdSearch& search, const Followed& before, Followed& now,
                                       const std::vector<Match>& matches);

} // namespace squeal
