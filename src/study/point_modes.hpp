#pragma once
/// The modes of a sliding equilibrium on a basis that serves many, with left vectors, checked by the full residual
/// (src/README.md, section 10.2).
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/dense_losses.hpp"
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

/// What modes are sought on, and how exactly.
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
  std::vector<TwoSidedPair> pairs; // falling growth rate, up to a little beyond the band
  std::vector<double> errors;      // the larger backward error of both vectors
  Eigen::MatrixXd M{}, C{};        // of the point, on the basis
};

/// The backward error of vectors that are exact.
inline constexpr double exact_tolerance = 1e-10;

/// Backward errors that studies ask for at most. The error of an eigenvalue is the product of those of both vectors,
/// magnified by its nearness to others and by what the matrices are larger than on the modes: these leave the
/// eigenvalues of 5395 degrees of freedom within 3e-10 of those at 1e-10, in 14 instead of 49 s.
inline constexpr double close_tolerance = 1e-8;

/// Error: a closed pair that friction jams. The closed pairs include those of the basis.
PointModes find_point_modes(ModesBasis& basis, const PointProblem& problem);

/// Modes are followed a little beyond the band, so that none is lost at its end.
inline constexpr double followed_band = 1.05;

/// Whether |lambda| is below the end of a band [Hz].
bool in_band(const TwoSidedPair& pair, double band);

} // namespace squeal
