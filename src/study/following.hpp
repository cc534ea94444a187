#pragma once
/// Modes followed from point to point by the biorthogonal MAC, and where they become unstable or stable between two
/// points (src/README.md, sections 10.3 and 10.5).
#include "point_modes.hpp"
#include "squeal/study/sweep.hpp"

#include <functional>

namespace squeal
{

/// Where a mode goes.
struct Match
{
  int to = -1;      // place among the modes of the next point; -1: unclear
  double mac = 0;   // of the mode, or of the subspace
  int subspace = 1; // number of modes that are matched together
};

/// A point with its modes on the basis, and the track of each.
struct Followed
{
  std::vector<double> values;
  bool reversed = false;
  bool inserted = false;
  int closed = 0; // pairs
  PointModes modes{};
  std::vector<int> tracks{}; // -1: none
};

/// At least this much of a mode, or of a subspace, must be found again.
inline constexpr double clear_mac = 0.9;

/// The same where other pairs are closed: modes jump there. More than half of a mode is in one other alone.
inline constexpr double clear_mac_across = 0.6;

/// How near a ratio is to 1: one above 1 is as far off as its inverse. Of a ratio of the form b it is the MAC.
double folded(double ratio);

/// The form b of section 10.3 between the modes of two points, with the matrices of one of them.
struct ModeForms
{
  Eigen::MatrixXcd there, back; // left of the first with right of the second, and the reverse
  Eigen::MatrixXcd first, second;
};

/// The MAC of each mode of the first with each of the second point.
Eigen::MatrixXd all_macs(const ModeForms& forms);

/// On the basis that both points share. Not collective.
ModeForms forms_between(const PointModes& from, const PointModes& to);

/// For each mode of a point the place of the mode of a reference that it shares most with, and whose frequency is not
/// far from its own; -1: it is like none. Not collective.
std::vector<int> names_by_shapes(const PointModes& reference, const PointModes& point);

/// For each mode of the first point its match at the second one, by the MAC of right with left vectors, which is at
/// least `clear`. Not collective.
std::vector<Match> follow(const ModeForms& forms, double clear);

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
