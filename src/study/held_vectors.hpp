#pragma once
/// Right and left vectors of unstable modes, and what a model makes of them while they are held (src/README.md, section
/// 11.1). Every function is collective.
#include "squeal/modes/two_sided.hpp"
#include "squeal/study/sensitivity.hpp"

namespace squeal
{

/// Modes with both vectors in the structure's degrees of freedom: real parts of all, then imaginary parts. The vectors
/// solve
///     Q right = R' reactions,   B_n right + c reactions = 0,   Q'left + B_n' sides = 0,   R left = c sides
/// on the closed pairs, R = B_n + mu e.B_t, c their compliance.
struct HeldVectors
{
  std::vector<std::complex<double>> lambda{};
  MultiVector right, left;
  std::vector<std::vector<std::complex<double>>> reactions{}, sides{}; // by modes and pairs; 0 on open pairs

  std::size_t count() const { return lambda.size(); }
};

/// B_n x and mu e.B_t x of every pair: their sum is R x.
struct PairMotions
{
  std::vector<std::complex<double>> normal, friction;
};

/// What one model makes of vectors that are held.
struct AtHeldVectors
{
  std::vector<std::complex<double>> residual; // left'(Q right - R' reactions) + sides'(B_n right + c reactions)
  std::vector<std::complex<double>> slopes;   // left' Q'(lambda) right
  // right^H A right of M, C without friction and losses, K with the springs of the pairs, and the K of loss factors
  std::vector<double> mass, damping, stiffness, loss;
};

/// Column j of X.
Owned<Vec> column(const MultiVector& X, std::size_t j, Vec pattern);

/// Of the mode's vector in X, whose columns are the real parts of `count` modes and then the imaginary ones.
PairMotions pair_motions(const Interface& interface, const MultiVector& X, std::size_t mode, std::size_t count,
                         Vec pattern);

/// right^H A right of each mode, A symmetric.
std::vector<double> quadratic_forms(Mat A, const HeldVectors& vectors);

AtHeldVectors at_held_vectors(const SlidingEquilibrium& sliding, const HeldVectors& vectors);

/// The unstable modes with their left vectors. Sets the modes of the result, and its outcome where one was not found:
/// then there are none.
HeldVectors unstable_vectors(const SensitivityProblem& problem, Sensitivity& result);

} // namespace squeal
