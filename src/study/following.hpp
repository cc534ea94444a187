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
  int cluster = -1; // the first of them
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

/// The same for the overlap of modes of opposite directions of rotation, which falls near lock-in. On the pin with two
/// divisions at mu = 0.05 modes share at least 0.33 with themselves, and less than 0.05 with others [6ea0b68].
inline constexpr double clear_overlap = 0.25;

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

/// On the basis that both points share; equal pairs are closed. Not collective.
ModeForms forms_between(const PointModes& from, const PointModes& to);

/// Products y^H M y' of right vectors, in place of b: between opposite directions of rotation. Turning friction round
/// turns right into left vectors, so that b would match a mode with its partner near lock-in. Not collective.
ModeForms overlaps_between(const PointModes& from, const PointModes& to);

/// Of modes that share less than `clear_mac`, those are matched whose eigenvalues are each other's nearest and coincide
/// to 1e-5, as in the mirror image of a scene. Between opposite directions of rotation. Not collective.
void match_coincident(std::vector<Match>& matches, const std::vector<TwoSidedPair>& from,
                      const std::vector<TwoSidedPair>& to);

/// Modes in the structure's degrees of freedom, as `expanded` gives them.
struct ExpandedModes
{
  const std::vector<TwoSidedPair>& pairs;
  MultiVector right, left;
};

/// In the structure's degrees of freedom, whatever pairs are closed. `C`: with G and C_f, without loss factors.
/// Collective.
ModeForms forms_between(const ExpandedModes& from, const ExpandedModes& to, Mat M, Mat C);

/// For each mode of the first point its match at the second one, by the MAC of right with left vectors, which is at
/// least `clear`. Not collective.
std::vector<Match> follow(const ModeForms& forms, double clear);

} // namespace squeal
