#pragma once
/// Dense Cholesky factor, on one process, of a positive definite A bordered by rows B that are not eliminated:
///     A = L L',   the influence A^-1 B'   and the Schur complement B A^-1 B'.
/// A solve has the two halves of Cholesky's (cholesky.hpp): B A^-1 b is the transposed influence times b.
#include "triplets.hpp"

#include <Eigen/Core>

namespace squeal
{

class DenseFactor
{
public:
  /// `lower`: the lower triangle of A and, from row dofs + 1 on, B.
  DenseFactor(const Triplets& lower, int dofs, int border);

  /// Whether A is not positive definite; the factor is then not to be used.
  bool failed() const { return failed_; }

  /// B A^-1 B' by columns, of which the lower triangle is set. Moves its storage out: call it once.
  std::vector<double> take_schur_complement() { return std::move(schur_complement_); }

  /// B A^-1 b of `columns` right-hand sides, `dofs` long each; keeps b.
  std::vector<double> forward(const std::vector<double>& b, int columns);

  /// A^-1 (b - B' lambda) into x.
  void backward(const std::vector<double>& lambda, std::vector<double>& x);

  /// Entries of L.
  double entries() const;

private:
  Eigen::MatrixXd L_, influence_;
  Eigen::MatrixXd right_{};
  std::vector<double> schur_complement_;
  bool failed_ = false;
};

} // namespace squeal
