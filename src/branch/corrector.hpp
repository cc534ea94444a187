#pragma once
/// The corrector of a branch: closed orbits beside a predicted one (src/README.md, section 9.2).
///
/// Quasi-Newton on z = (x, T, p) with the rows of phase and arclength. Pairs (dz, P^-1 dF) of earlier steps stand for
/// the Jacobian. Where they serve no longer, GCR with exact columns of the tangent solves the linear system, and its
/// pairs replace them. A point costs few periods as long as the Jacobian changes little.
#include "squeal/branch/continuation.hpp"
#include "squeal/shooting/secants.hpp"

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

/// A closed orbit, and the value that it belongs to.
struct CorrectedOrbit
{
  Orbit orbit;
  double parameter = 0;
  int iterations = 0;
};

BorderedVector vector_of(const CorrectedOrbit& corrected);

/// The closed orbit on the plane through `predicted` that is square to `normal`. None: it was not found.
std::optional<CorrectedOrbit> correct(BranchCorrector& corrector, const BorderedVector& predicted,
                                      const BorderedVector& normal);

/// The direction of the branch at a closed orbit, of scaled length 1, on the side of the direction `about`.
BorderedVector tangent_at(BranchCorrector& corrector, const CorrectedOrbit& corrected, const BorderedVector& about);

} // namespace squeal
