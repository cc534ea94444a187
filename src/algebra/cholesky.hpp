#pragma once
/// Supernodal multifrontal Cholesky factor, on one process, of a positive definite A bordered by rows B that are not
/// eliminated:
///     A = L L',   E = B L^-T,   B A^-1 B' = E E',
/// so that a solve falls in two halves, y = L^-1 b with E y = B A^-1 b, and x = L^-T (y - E' lambda).
#include "elimination.hpp"

namespace squeal
{

class Cholesky
{
public:
  /// `lower`: the lower triangle of A and, from row dofs + 1 on, B, of which `order` is.
  Cholesky(Triplets lower, Elimination order);

  /// A is not positive definite: the factor is of no use.
  bool failed() const { return failed_; }

  /// E E', once, its lower triangle by columns; gives its storage away.
  std::vector<double> take_corner() { return std::move(corner_); }

  /// E L^-1 b of `columns` right-hand sides, `dofs` long each; keeps L^-1 b.
  std::vector<double> forward(const std::vector<double>& b, int columns);

  /// L^-T (L^-1 b - E' lambda) into x.
  void backward(const std::vector<double>& lambda, std::vector<double>& x);

  double entries() const { return order_.entries; }

private:
  bool factorise(Triplets lower);

  Elimination order_;
  std::vector<double> values_; // L and E, packed
  std::vector<double> corner_;
  std::vector<double> work_;            // L^-1 b, the columns' entries of a position side by side
  std::size_t columns_ = 0, lanes_ = 0; // of `work_`: lanes_ - columns_ are idle
  bool failed_ = false;
};

/// What a Cholesky in this order holds at its largest, the corner apart [bytes].
double cholesky_memory(const Elimination& order);

} // namespace squeal
