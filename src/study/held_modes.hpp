#pragma once
/// Unstable modes with right and left vectors, and what a model makes of them while they are held (src/README.md,
/// section 11.1). Every function is collective.
#include "squeal/modes/passes.hpp"
#include "squeal/study/sensitivity.hpp"

namespace squeal
{

/// A mode with vectors in the structure's degrees of freedom, by their real and imaginary parts. They solve
///     Q right = R' reactions,   B_n right + c reactions = 0,   Q'left + B_n' sides = 0,   R left = c sides
/// on the closed pairs, R = B_n + mu e.B_t, c their compliance. Pairs that stick have B_t right = B_t left = 0, or with
/// elastic slip c_t springs B_t'B_t/c_t in Q. The right one is the scene's mode, and
/// left'Q'(lambda) right = 1.
struct HeldMode
{
  std::complex<double> lambda;
  MultiVector right{}, left{};
  std::vector<std::complex<double>> reactions{}, sides{}; // by pairs; 0 on open pairs
};

/// B x on the rows of the pairs, of real and imaginary parts.
Eigen::VectorXcd pair_rows(const Interface& interface, const MultiVector& x);

/// B_n x and mu e.B_t x of every pair, whose sum is R x, and B_t x over the root of c_t, 0 without elastic slip.
struct PairMotions
{
  std::vector<std::complex<double>> normal, friction;
  std::vector<std::array<std::complex<double>, 2>> elastic;
};

PairMotions pair_motions(const Interface& interface, const MultiVector& x);

/// x^H A x, A symmetric; 0 without a matrix.
double quadratic_form(Mat A, const MultiVector& x);

/// left'(Q right - R' reactions) + sides'(B_n right + c reactions) of each mode, by the matrices of a model.
std::vector<std::complex<double>> residuals_at(const SlidingEquilibrium& sliding, const std::vector<HeldMode>& modes);

/// The unstable modes with their left vectors. Sets the modes of the result, and its outcome where one was not found:
/// then there are none.
std::vector<HeldMode> unstable_modes(const SensitivityProblem& problem, Sensitivity& result);

} // namespace squeal
