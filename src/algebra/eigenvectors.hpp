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

} // namespace squeal
