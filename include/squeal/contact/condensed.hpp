#pragma once
/// The factor of a matrix A bordered by the rows B of the pairs. The condensed contact operator W = scale B A^-1 B'
/// comes from it (src/README.md, sections 4.4 and 8.4).
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/contact/interface.hpp"

#include <optional>

namespace squeal
{

/// A factored, bordered by the interface's B. Collective.
/// Error: A singular, naming (`describe`) the offending degree of freedom by the names of rank 0 of A's ranks.
Factor factor_held(Mat A, const Interface& interface, const DofNames& names, const FactorOptions& options);

/// A symmetric matrix A, bordered by the interface's B, and whether it is positive definite.
struct Factored
{
  Factor factor; // of no use where `loose` is set
  /// The degree of freedom that moves most in a motion x whose resistance is below rounding; none: A is definite.
  std::optional<PetscInt> loose;
  bool indefinite = false; // in that motion x'A x < 0
  double resistance = 0;   // x'A x / x' diag(A) x, the least that inverse iteration found
};

/// Factors A bordered by B, after inverse iteration where A is not definite. Collective. Error: memory runs out.
Factored factor_positive(Mat A, const Interface& interface, const FactorOptions& options);

} // namespace squeal
