#pragma once
/// The modes of a sliding equilibrium on a basis that serves many, with left vectors, checked by the full residual
/// (src/README.md, section 10.2).
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/modes.hpp"
#include "squeal/modes/quadratic.hpp"
#include "squeal/reduction/sliding_basis.hpp"
#include "squeal/study/sweep.hpp"

#include <functional>

namespace squeal
{

/// Modes of the frictionless structure in and beyond the band, corrected wherever a point needs it.
struct ModesBasis
{
  SlidingBasis basis;
  std::vector<char> attached{}; // pairs beyond those closed at every point whose static shapes the basis holds
  ClosedContact contact{};      // of the pairs that are closed and rigid at every point: without friction
  std::vector<char> closed{};   // those pairs
  Owned<Mat> M_z{}, K_z{};      // with the springs of pairs that have a compliance where the basis was made
  Owned<Mat> Z_transposed{};
  ShiftInvert pencil{};   // of K_z, M_z just below zero
  QuadraticNorms norms{}; // of M_z, C_z and K_z
  int passes = 0;         // corrections so far
};

/// The structure on which a basis is made, with the pairs that are closed there, and the band of its modes [Hz].
struct BasisProblem
{
  const Structure& structure;
  const Interface& interface;
  const std::vector<char>& closed;
  double band = 0;
  const ModesOptions& options;
};

/// `closed`: pairs that are closed and rigid at every point.
ModesBasis make_modes_basis(const BasisProblem& problem, const std::vector<char>& closed);

/// Goes over to fewer closed pairs: their modes join the basis, whose shapes keep their places.
void rebase(ModesBasis& modes, const BasisProblem& problem, const std::vector<char>& closed);

/// The corrections (K_z - tau M_z)^-1 r of residuals join the basis, but for those much smaller than the largest.
/// Returns whether they add anything.
bool correct(ModesBasis& modes, MultiVector residuals);

/// The scale of backward errors, w^2 |M| + w |C| + |K| with w = |lambda| [N/m].
double scale_of(const ModesBasis& modes, std::complex<double> lambda);

/// The problem whose modes are sought, and its tolerances.
struct PointProblem
{
  const SlidingEquilibrium& sliding;
  double band = 0;                           // [Hz]
  double tolerance = 0;                      // on the backward error of right and left vectors
  const std::function<void()>& end_if_asked; // called before each solution
};

/// Vectors are coefficients of the basis; those of earlier points lack the shapes that came later.
/// outcome: "converged", or "not converged": an eigenvalue of the basis exceeds the tolerance. Then those that exceed
/// 1e-8 as well are left out.
struct PointModes
{
  Outcome outcome;
  std::vector<DenseEigenpair> pairs; // falling growth rate, up to a little beyond the band
  std::vector<double> errors;        // the larger backward error of both vectors
  Eigen::MatrixXd M{}, C{};          // of the point, on the basis
};

/// The backward error of vectors that are exact.
inline constexpr double exact_tolerance = 1e-10;

/// Backward errors that studies ask for at most. The error of an eigenvalue is the product of those of both vectors.
/// Its nearness to others magnifies it, and the size of the matrices beside that on the modes.
inline constexpr double close_tolerance = 1e-8;

/// Error: a closed pair that friction jams. The closed pairs include those of the basis.
PointModes find_point_modes(ModesBasis& basis, const PointProblem& problem);

/// Modes are followed a little beyond the band, so that none is lost at its end.
inline constexpr double followed_band = 1.05;

/// Whether |lambda| is below the end of a band [Hz].
bool in_band(const DenseEigenpair& pair, double band);

// Modes followed from point to point by the biorthogonal MAC, and where they become unstable or stable between two
// points (src/README.md, sections 10.3 and 10.5).

/// Where a mode goes.
struct Match
{
  int to = -1;      // place among the modes of the next point; -1: unclear
  double mac = 0;   // of the mode, or of the subspace
  int subspace = 1; // number of modes that are matched together
};

/// A point with its modes on the basis, and the track of each.
struct Followed : SweptPlace
{
  bool inserted = false;
  int closed = 0; // pairs
  PointModes modes{};
  std::vector<int> tracks{}; // -1: none
};

/// At least this much of a mode, or of a subspace, must be found again.
inline constexpr double clear_mac = 0.9;

/// The least MAC of a match across a change of closed pairs, where modes jump: at most one other mode exceeds half.
inline constexpr double clear_mac_across = 0.6;

/// The ratio, or its inverse where it exceeds 1. Of a ratio of the form b it is the MAC.
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

/// The place, for each mode of a point, of the reference's mode that it shares most with, of a near frequency; -1: it
/// is like none. Not collective.
std::vector<int> names_by_shapes(const PointModes& reference, const PointModes& point);

/// For each mode of the first point its match at the second one. The MAC of its right with the match's left vector is
/// at least `clear`. Not collective.
std::vector<Match> follow(const ModeForms& forms, double clear);

/// The functions of a search between two points.
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
