#pragma once
/// A mode with its left vector, of the whole problem whatever its matrices (src/README.md, sections 3.11 and 11.1):
///     Q(lambda) y = 0,   Q(lambda)'x = 0,   Q = lambda^2 M + lambda C + K + f K_loss
/// f is i of complex stiffness, 0 of a real lambda.
///
/// Both vectors are sought by residual passes on subspaces of their own (passes.hpp), with one factor of the symmetric
/// problem at tau = -Re(lambda^2). The two-sided Rayleigh quotient then moves lambda.
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/quadratic.hpp"

namespace squeal
{

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
