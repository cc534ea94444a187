#pragma once
/// The condensed contact operator W = scale B A^-1 B' (dense, symmetric, whole on rank 0) and the factor of A it came
/// from (MUMPS, L L').
#include "squeal/contact/interface.hpp"

#include <optional>

namespace squeal
{

struct CondensedOperator
{
  Owned<Mat> factor;     // of A, by MUMPS, all ranks
  std::vector<double> W; // row-major, size x size; on rank 0 only, empty elsewhere
  int size = 0;          // pairs * block
};

/// Factors A (symmetric) and forms W from blocks of sparse right-hand sides. Collective.
/// Error: A singular, naming (`describe`) the offending degree of freedom.
CondensedOperator condense(Mat A, const Interface& interface, double scale, const DofNames& names);

/// x = A^-1 b with the factor.
void solve(const CondensedOperator& condensed, Vec b, Vec x);

/// The parts of `condense`, for A symmetric and meant to be positive definite; `loose`: the degree of freedom that
/// moves most in a motion that A resists with less than rounding of its diagonal, if there is one (the factor is then
/// of no use).
struct Factored
{
  Owned<Mat> factor;
  std::optional<PetscInt> loose;
};

Factored factor_positive(Mat A);

/// scale B A^-1 B' on rank 0; empty elsewhere.
std::vector<double> condensed_matrix(Mat factor, const Interface& interface, double scale);

} // namespace squeal
