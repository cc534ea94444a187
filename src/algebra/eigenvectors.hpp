#pragma once
/// Eigenvalues and vectors of a dense real or complex matrix, by LAPACK. Error: the QR algorithm does not converge.
#include "squeal/algebra/dense_eigenproblems.hpp"

namespace squeal
{

enum class Vectors
{
  none,
  right,
  both
};

/// Eigenvalues mu of a matrix with their vectors as columns. Left ones u obey u^H A = mu u^H.
struct Eigenvectors
{
  Eigen::VectorXcd mu;
  Eigen::MatrixXcd left{}, right{}; // empty: not wanted
};

Eigenvectors eigenvectors(Eigen::MatrixXd A, Vectors which);
Eigenvectors eigenvectors(Eigen::MatrixXcd A, Vectors which);

/// Both vectors of those eigenvalues whose modulus is `edge` or more; of all where they are too many for less work, or
/// one side has others than the other.
Eigenvectors dominant_eigenvectors(const Eigen::MatrixXd& A, double edge);
Eigenvectors dominant_eigenvectors(const Eigen::MatrixXcd& A, double edge);

} // namespace squeal
