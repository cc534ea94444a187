#pragma once
/// Supernodal multifrontal Cholesky factor, on one process, of a positive definite A bordered by rows B that are not
/// eliminated (src/README.md, sections 8.1 and 8.2):
///     A = L L',   E = B L^-T,   B A^-1 B' = E E' (Schur complement),
/// so that a solve has two halves, y = L^-1 b with E y = B A^-1 b, and x = L^-T (y - E' lambda).
#include "symbolic_factor.hpp"

namespace squeal
{

class Cholesky
{
public:
  /// `lower`: the lower triangle of A and, from row dofs + 1 on, B, whose analysis is `symbolic`.
  Cholesky(Triplets lower, SymbolicFactor symbolic);

  /// Whether A is not positive definite; the factor is then not to be used.
  bool failed() const { return failed_; }

  /// E E' by columns, of which the lower triangle is set. Moves its storage out: call it once.
  std::vector<double> take_schur_complement() { return std::move(schur_complement_); }

  /// E L^-1 b of `columns` right-hand sides, `dofs` long each; keeps L^-1 b.
  std::vector<double> forward(const std::vector<double>& b, int columns);

  /// L^-T (L^-1 b - E' lambda) into x.
  void backward(const std::vector<double>& lambda, std::vector<double>& x);

  /// Entries of L and E.
  double entries() const { return symbolic_.entries; }

private:
  bool factorise(Triplets lower);

  SymbolicFactor symbolic_;
  std::vector<double> values_; // L and E, packed
  std::vector<double> schur_complement_;
  std::vector<double> work_;            // L^-1 b: the entries of all columns at a position are neighbours
  std::size_t columns_ = 0, lanes_ = 0; // of `work_`: lanes_ - columns_ of each position are not used
  bool failed_ = false;
};

/// The largest memory that a Cholesky takes, without its Schur complement [bytes].
double cholesky_memory(const SymbolicFactor& symbolic);

} // namespace squeal
