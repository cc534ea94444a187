#pragma once
/// The quadratic eigenproblem on a small subspace that is corrected by residuals (src/README.md, section 3.7).
///
/// On an orthonormal V, V'(lambda^2 M + lambda C + K) V a = 0 is small and dense. The residual r of a pair y = V a
/// shows what V lacks: P^-1 r is appended to V, where P is a factor that is at hand, for some passes. All functions are
/// collective. Error: memory runs out, or LAPACK does not converge on the small problem.
#include "squeal/algebra/pencil_factor.hpp"
#include "squeal/modes/quadratic.hpp"
#include "squeal/modes/real_modes.hpp"

namespace squeal
{

/// Each pass corrects the pairs of largest growth ratio, Re/|lambda|, whose backward error exceeds a tolerance. From a
/// growth ratio of -1e-3 on the tolerance is `sharp`. The error of an eigenvalue may be 1e4 times its backward error,
/// and growth is a small part of the eigenvalue.
struct Correction
{
  Window window;        // the pairs sought
  int passes = 0;       // at most
  PetscInt pairs = 0;   // corrected in each pass, at most
  double tolerance = 0; // backward error
  double sharp = 0;     // the same of nearly critical pairs
  double share = 0;     // directions of the residuals below this part of the largest are left to later passes

  double tolerance_of(std::complex<double> lambda) const
  {
    constexpr double critical = -1e-3; // growth ratio
    return lambda.real() > critical * std::abs(lambda) ? sharp : tolerance;
  }
};

/// `basis` spans the first V. Backward errors are those of `problem` itself. With the K_loss of loss factors, which may
/// be null, only pairs that oscillate are sought, by complex stiffness. The caller sets outcome.kind.
QuadraticSolution solve_on_subspace(const QuadraticProblem& problem, Mat K_loss, MultiVector basis,
                                    const PencilFactor& P, const Correction& correction);

/// How the route by projection is taken.
struct ProjectionSettings
{
  double band = 0;         // [Hz]
  int passes = 0;          // of residual correction
  PetscInt candidates = 0; // pairs corrected in each pass
  PencilOptions pencil{};
};

/// Solves on the first real modes, corrected by static responses of the symmetric stiffness without friction (Brizard,
/// Chiello, Sinou, Lorang 2011). Caveat: an unstable pair that appears well damped on the first basis may be missed;
/// only the full problem is certain. `M`, `K`: the symmetric problem of the real modes `basis`, in the unknowns y of
/// `problem`.
QuadraticSolution solve_projected(const QuadraticProblem& problem, Mat M, Mat K, const RealModes& basis,
                                  const ProjectionSettings& settings);

} // namespace squeal
