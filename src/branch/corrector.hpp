#pragma once
/// The corrector of a branch: closed orbits beside a predicted one (src/README.md, section 9.2).
///
/// Quasi-Newton on z = (x, T, p) with the rows of phase and arclength. Pairs (dz, P^-1 dF) of earlier steps stand for
/// the Jacobian. Where they serve no longer, GCR with exact columns of the tangent solves the linear system, and its
/// pairs replace them. A point costs few periods as long as the Jacobian changes little.
#include "squeal/branch/continuation.hpp"

#include <deque>
#include <optional>

namespace squeal
{

/// z, or a change of it.
struct BranchVector
{
  Owned<Vec> state;
  double period = 0, parameter = 0; // [s]
};

BranchVector copy_of(const BranchVector& z);

/// y += factor x
void add(double factor, const BranchVector& x, BranchVector& y);

void scale(double factor, BranchVector& z);

/// What makes unknowns comparable: z is measured by its parts over these.
struct BranchScales
{
  double fluctuation = 1, period = 1, parameter = 1;
};

/// A change of z and what it does to the preconditioned defect.
struct BranchSecant
{
  BranchVector step;
  Owned<Vec> change; // P^-1 dF
};

struct BranchCorrector
{
  const FlowFamily& family;
  const ContinuationSettings& settings;
  const ShootingOptions& options;
  ConvergenceLog& log;
  BranchScales scales{};
  Owned<Vec> rest{};                  // of the last point
  double period = 0;                  // [s] of the last point
  Owned<Vec> parameter_column{};      // dPhi/dp where the Jacobian was formed last
  std::deque<BranchSecant> secants{}; // newest first
  long columns = 0;                   // of the tangent
};

/// Of two changes, in the scaled unknowns.
double scaled_product(const BranchCorrector& corrector, const BranchVector& a, const BranchVector& b);

/// The orbit problem about the last point.
OrbitProblem problem_of(const BranchCorrector& corrector);

/// A closed orbit, and the value that it belongs to.
struct CorrectedOrbit
{
  Orbit orbit;
  double parameter = 0;
  int iterations = 0;
};

BranchVector vector_of(const CorrectedOrbit& corrected);

/// The closed orbit on the plane through `predicted` that is square to `normal`. None: it was not found.
std::optional<CorrectedOrbit> correct(BranchCorrector& corrector, const BranchVector& predicted,
                                      const BranchVector& normal);

/// The direction of the branch at a closed orbit, of scaled length 1, on the side of the direction `about`.
BranchVector tangent_at(BranchCorrector& corrector, const CorrectedOrbit& corrected, const BranchVector& about);

} // namespace squeal
