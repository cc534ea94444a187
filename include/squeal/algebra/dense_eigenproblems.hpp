#pragma once
/// Eigenproblems of dense matrices, solved by Eigen with LAPACK underneath (src/README.md, section 8.8). Matrices are
/// square; `Matrix` is Eigen::MatrixXd or MatrixXcd. Functions whose name ends in _shared are collective; the others
/// work on one rank alone. Where LAPACK does not converge they throw Error.
#include "squeal/algebra/dense_matrix.hpp"

#include <cmath>
#include <complex>
#include <span>
#include <vector>

namespace squeal
{

/// An eigenvalue with its vector, of 2-norm 1.
struct DenseEigenpair
{
  std::complex<double> lambda;
  Eigen::VectorXcd y; // 2-norm 1
};

/// An eigenvalue with both of its vectors: Q(lambda) right = 0, left' Q(lambda) = 0, Q = lambda^2 M + lambda C + K; the
/// prime transposes without conjugation. 2-norms are 1. Q may have loss factors too (dense_losses.hpp).
struct TwoSidedPair
{
  std::complex<double> lambda;
  Eigen::VectorXcd right, left;
};

/// The vectors of one side as columns; empty without pairs.
Eigen::MatrixXcd vectors_of(std::span<const TwoSidedPair> pairs, Eigen::VectorXcd TwoSidedPair::*side);

/// The pairs of solve_dense_quadratic_shared with |lambda| <= limit and their left vectors, from the matrices of rank
/// 0, on every rank. Collective.
template <class Matrix> std::vector<TwoSidedPair>
solve_two_sided_shared(MPI_Comm comm, const Matrix& M, const Matrix& C, const Matrix& K, double limit = HUGE_VAL);

/// Gives every rank the pairs of rank 0, whose vectors have so many rows. Collective.
void share(MPI_Comm comm, std::vector<TwoSidedPair>& pairs, Eigen::Index rows);

/// The pairs (lambda^2 M + lambda C + K) y = 0 with Im(lambda) >= 0 and finite lambda, from the matrices of rank 0, on
/// every rank. M, C and K are of one size and not symmetric in general. Collective.
template <class Matrix> std::vector<DenseEigenpair> solve_dense_quadratic_shared(MPI_Comm comm, const Matrix& M,
                                                                                 const Matrix& C, const Matrix& K);

/// All eigenpairs of A, the largest modulus first, of a complex pair first the one with Im(lambda) > 0.
std::vector<DenseEigenpair> solve_dense_unsymmetric(const Eigen::MatrixXd& A);

/// Real columns that span the pairs' vectors, which have `size` entries, one column a pair: the real part where
/// Im(lambda) >= 0, the imaginary part of the other one.
Eigen::MatrixXd real_columns(const std::vector<DenseEigenpair>& pairs, Eigen::Index size);

std::vector<std::complex<double>> values_of(const std::vector<DenseEigenpair>& pairs);

/// For each reference the place of a value of its own. No two references come nearer to their values, by the sum of
/// both distances, when they exchange them. There are at least as many values.
std::vector<std::size_t> nearest_places(const std::vector<std::complex<double>>& references,
                                        const std::vector<std::complex<double>>& values);

/// Eigenvalues in ascending order and a vector for each, as the columns of y.
struct SymmetricEigenpairs
{
  Eigen::VectorXd lambda;
  Eigen::MatrixXd y;
};

/// The pairs of a symmetric A, with y of 2-norm 1, by divide and conquer: six times as fast as QR at 1200 rows.
SymmetricEigenpairs solve_dense_symmetric(Eigen::MatrixXd A);

/// The finite eigenvalues of K y = lambda M y and M-normalised y. M is symmetric positive semidefinite,
/// K - shift M symmetric positive definite, shift < 0.
SymmetricEigenpairs solve_dense_symmetric(const Eigen::MatrixXd& M, const Eigen::MatrixXd& K, double shift);

/// These pairs from the matrices of rank 0, on every rank. Collective.
SymmetricEigenpairs solve_dense_symmetric_shared(MPI_Comm comm, const Eigen::MatrixXd& M, const Eigen::MatrixXd& K,
                                                 double shift);

} // namespace squeal
