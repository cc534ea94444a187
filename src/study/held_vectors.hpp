#pragma once
/// Right and left vectors of unstable modes, and what a model makes of them while they are held (src/README.md, section
/// 11.1). Every function is collective.
#include "squeal/reduction/sliding_basis.hpp"
#include "squeal/study/sensitivity.hpp"

namespace squeal
{

/// Modes with both vectors in the structure's degrees of freedom: real parts of all, then imaginary parts.
struct HeldVectors
{
  std::vector<std::complex<double>> lambda{};
  MultiVector right, left;
  SlidingBasis basis;                                         // the right vectors, then the left ones
  std::vector<std::vector<std::complex<double>>> reactions{}; // [N] normal ones, by modes and pairs; 0 on open pairs

  std::size_t count() const { return lambda.size(); }
};

/// B_n x and mu e.B_t x of every pair.
struct PairMotions
{
  std::vector<std::complex<double>> normal, friction;
};

/// Of a mode's right vector.
PairMotions pair_motions(const SlidingEquilibrium& sliding, const HeldVectors& vectors, std::size_t mode);

/// The real and the imaginary part of a mode's right vector.
std::array<Owned<Vec>, 2> right_parts(const HeldVectors& vectors, std::size_t mode, Vec pattern);

/// right^H A right of each mode, A symmetric; zeros without a matrix.
std::vector<double> quadratic_forms(Mat A, const HeldVectors& vectors);

/// One model's left'Q right and left'Q'(lambda) right, with the vectors lifted over the pairs that are closed there.
struct AtHeldVectors
{
  std::vector<std::complex<double>> residual, slopes;
};

AtHeldVectors at_held_vectors(const SlidingEquilibrium& sliding, HeldVectors& vectors);

/// The unstable modes with their left vectors. Sets the modes of the result, and its outcome where one was not found:
/// then there are none.
HeldVectors unstable_vectors(const SensitivityProblem& problem, Sensitivity& result);

} // namespace squeal
