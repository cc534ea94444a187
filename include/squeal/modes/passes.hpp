#pragma once
/// The quadratic eigenproblem on a small subspace that is corrected by residuals (src/README.md, section 3.7).
///
/// On an orthonormal V, V'Q(lambda) V a = 0 is small and dense, Q = lambda^2 M + lambda C + K + f K_loss with f of
/// dense_losses.hpp. The residual r of a pair y = V a shows what V lacks: P^-1 r is appended to V, pass after pass. All
/// functions are collective. Error: memory runs out, or LAPACK does not converge on the small problem.
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/quadratic.hpp"

#include <optional>

namespace squeal
{

/// Each pass corrects pairs whose backward error exceeds a tolerance. From a growth ratio Re/|lambda| of -1e-3 on the
/// tolerance is `sharp`. The error of an eigenvalue may be 1e4 times its backward error, and growth is a small part of
/// the eigenvalue.
struct Correction
{
  Window window;                              // the pairs sought
  int passes = 0;                             // at most
  std::size_t pairs = 0;                      // corrected in each pass, at most
  double tolerance = 0;                       // backward error
  double sharp = 0;                           // the same of nearly critical pairs
  double share = 0;                           // directions of the residuals below this part of the largest wait
  std::optional<std::complex<double>> near{}; // pairs near it come first; else those of largest growth ratio

  double tolerance_of(std::complex<double> lambda) const
  {
    constexpr double critical = -1e-3; // growth ratio
    return lambda.real() > critical * std::abs(lambda) ? sharp : tolerance;
  }
};

/// `basis` spans the first V. Backward errors are those of `problem` itself. With the K_loss of loss factors, which may
/// be null, pairs that oscillate are those of complex stiffness. P is an inverse of the problem at some shift, or
/// nearly; without passes it may be null. The caller sets outcome.kind.
QuadraticSolution solve_on_subspace(const QuadraticProblem& problem, Mat K_loss, MultiVector basis,
                                    const PencilFactor* P, const Correction& correction);

/// The pairs of a window from the whole problem, which is small. outcome: "converged".
QuadraticSolution solve_whole(const QuadraticProblem& problem, Mat K_loss, const Window& window);

/// An orthonormal basis of the real and imaginary parts of the pairs' vectors.
MultiVector span_of(std::span<const Eigenpair> pairs, Mat layout);

// A mode with its left vector, of the whole problem whatever its matrices (src/README.md, sections 3.11 and 11.1):
//     Q(lambda) y = 0,   Q(lambda)'x = 0,   Q = lambda^2 M + lambda C + K + f K_loss
// f is i of complex stiffness, 0 of a real lambda.
//
// Both vectors are sought by residual passes on subspaces of their own (passes.hpp), with one factor of the symmetric
// problem at tau = -Re(lambda^2). The two-sided Rayleigh quotient then moves lambda.

/// The problem and its transposed one.
struct TwoSidedProblem
{
  const QuadraticProblem& right;
  Mat K_loss = nullptr; // of one layout with them; null: none
  QuadraticProblem left;
  Owned<Mat> K_loss_t;
  ShiftInvert pencil{}; // of the symmetric problem
};

/// Borrows the matrices, and the symmetric K_z and M_z near them. Collective.
TwoSidedProblem make_two_sided(const QuadraticProblem& matrices, Mat K_loss, Mat K_z, Mat M_z,
                               const PencilOptions& options);

/// Vectors by their real and imaginary parts, in the rows of the problem.
struct TwoSidedMode
{
  std::complex<double> lambda;
  MultiVector right, left;
  double backward_error = 0; // the larger one of both vectors; infinite: not found
};

/// x'y without conjugation, of vectors by their real and imaginary parts. Collective.
std::complex<double> bilinear(const MultiVector& x, const MultiVector& y);

/// The mode near a lambda with a right vector. Collective. Error: memory runs out.
TwoSidedMode find_two_sided(TwoSidedProblem& problem, std::complex<double> lambda, const MultiVector& right);

} // namespace squeal
