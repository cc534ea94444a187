#pragma once
/// The corrector of a branch: closed orbits beside a predicted one (src/README.md, section 9.2).
///
/// Quasi-Newton on z = (x, T, p) with the rows of phase and arclength. Pairs (dz, P^-1 dF) of earlier steps stand for
/// the Jacobian. Where they serve no longer, GCR with exact columns of the tangent solves the linear system, and its
/// pairs replace them. A point costs few periods as long as the Jacobian changes little.
#include "squeal/branch/continuation.hpp"
#include "squeal/shooting/secants.hpp"

#include <array>
#include <optional>

namespace squeal
{

struct BranchCorrector
{
  const FlowFamily& family;
  const ContinuationSettings& settings;
  const ShootingOptions& options;
  ConvergenceLog& log;
  BorderedScales scales{};
  Owned<Vec> rest{};             // of the last point
  double period = 0;             // [s] of the last point
  Owned<Vec> parameter_column{}; // dPhi/dp where the Jacobian was formed last
  std::deque<Secant> secants{};  // newest first
  long columns = 0;              // of the tangent
};

/// The product of two changes, in the scaled unknowns.
double scaled_product(const BranchCorrector& corrector, const BorderedVector& a, const BorderedVector& b);

/// The orbit problem about the last point.
OrbitProblem problem_of(const BranchCorrector& corrector);

BorderedVector vector_of(const BranchPoint& point);

/// The closed orbit on the plane through `predicted` that is square to `normal`, not examined. None: it was not found.
std::optional<BranchPoint> correct(BranchCorrector& corrector, const BorderedVector& predicted,
                                   const BorderedVector& normal);

/// The direction of the branch at a closed orbit, of scaled length 1, on the side of the direction `about`.
BorderedVector tangent_at(BranchCorrector& corrector, const BranchPoint& point, const BorderedVector& about);

// Events between two points of a branch, and where they happen (src/README.md, section 9.3).

/// Whether multipliers are asked for.
enum class Examined
{
  measures_alone,
  multipliers_too,
};

/// Measures a point.
void examine(BranchCorrector& corrector, BranchPoint& point, Examined wanted);

/// The events from one point to the next one but the folds and those of multipliers.
std::vector<BranchEvent> events_between(BranchCorrector& corrector, const BranchPoint& from, const BranchPoint& to);

/// How many multipliers of a kind are beyond the unit circle, and the last orbit of which that is certain.
struct KnownBeyond
{
  BranchEventKind kind;
  int count = 0;
  std::size_t place = 0;
};

/// The numbers of multipliers beyond the unit circle at the start of a side, for each kind of event.
std::array<KnownBeyond, 2> known_beyond(const Multipliers& start);

/// The event by which the last of a side's orbits has another number of multipliers beyond the unit circle than is
/// known. It is where |m| = 1, as far as the bars tell. None where the number may be the same, or where multipliers
/// only met on the real axis.
std::optional<BranchEvent> crossing_among(BranchCorrector& corrector, const std::vector<BranchPoint>& orbits,
                                          KnownBeyond& known);

/// The turning point of the parameter near the second of three points in succession; none if it does not turn.
std::optional<BranchEvent> fold_among(BranchCorrector& corrector, const std::array<const BranchPoint*, 3>& points);

} // namespace squeal
