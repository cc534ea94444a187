#pragma once
/// The condensed contact operator W = scale B A^-1 B' (dense, symmetric, whole on rank 0) and the factor of A it came
/// from.
#include "squeal/contact/interface.hpp"

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

} // namespace squeal
