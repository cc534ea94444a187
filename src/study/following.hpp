#pragma once
/// Modes followed from point to point by the biorthogonal MAC (src/README.md, section 10.3).
#include "point_modes.hpp"

namespace squeal
{

/// Where a mode goes.
struct Match
{
  int to = -1;      // place among the modes of the next point; -1: unclear
  double mac = 0;   // of the mode, or of the subspace
  int subspace = 1; // number of modes that are matched together
};

/// At least this much of a mode, or of a subspace, must be found again.
inline constexpr double clear_mac = 0.9;

/// For each mode of a point its match at the next one, by the MAC of right with left vectors. Not collective.
std::vector<Match> follow(const PointModes& from, const PointModes& to);

} // namespace squeal
