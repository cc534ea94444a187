#pragma once
/// The condensed contact operator W = scale B A^-1 B' (dense, symmetric, whole on rank 0) and the factor of A it came
/// with.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/contact/interface.hpp"

#include <optional>

namespace squeal
{

struct CondensedOperator
{
  Factor factor;         // of A bordered by B
  std::vector<double> W; // row-major, size x size; on rank 0 only, empty elsewhere
  int size = 0;          // pairs * block
};

/// Factors A (symmetric) and forms W. Collective.
/// Error: A singular, naming (`describe`) the offending degree of freedom.
CondensedOperator condense(Mat A, const Interface& interface, double scale, const DofNames& names);

/// A factor for A symmetric and meant to be positive definite, bordered by the interface's B; `loose`: the degree of
/// freedom that moves most in a motion that A resists with less than rounding of its diagonal, if there is one (the
/// factor is then of no use).
struct Factored
{
  Factor factor;
  std::optional<PetscInt> loose;
  bool indefinite = false; // of `loose`: A drives that motion on
  double resistance = 0;   // least x'A x / x' diag(A) x found by inverse iteration
};

Factored factor_positive(Mat A, const Interface& interface);

} // namespace squeal
