#pragma once
/// Dense matrices that are whole on one rank or on all: copies, broadcasts, shares and linear systems.
#include "squeal/base/dense.hpp"
#include "squeal/base/petsc.hpp"

#include <cmath>
#include <span>
#include <vector>

namespace squeal
{

/// All entries of A on every rank. Collective.
Eigen::MatrixXd dense_copy(Mat A);

/// Gives every rank the size and the entries of a matrix or vector that rank 0 has. Collective.
template <int columns> void broadcast(Eigen::Matrix<double, Eigen::Dynamic, columns>& A, MPI_Comm comm)
{
  Eigen::Index size[2] = {A.rows(), A.cols()};
  MPI_Bcast(size, sizeof size, MPI_BYTE, 0, comm);
  A.resize(size[0], size[1]);
  MPI_Bcast(A.data(), to_int(A.size()), MPI_DOUBLE, 0, comm);
}

/// Consecutive columns, rows or entries: a rank's part of them.
struct Share
{
  Eigen::Index first = 0, count = 0;
};

/// This rank's part of `count` columns, rows or entries. Not collective.
Share share_of(Eigen::Index count, MPI_Comm comm);

/// Gives every rank the entries that the others computed of `count` ones of `length` numbers each, one after the other.
/// Collective.
void gather_shares(double* values, Eigen::Index count, Eigen::Index length, MPI_Comm comm);
/// Gathers the shared columns of A. Collective.
void gather_columns(Eigen::MatrixXd& A, MPI_Comm comm);

/// A x by two real products, which BLAS does: of a real with a complex matrix Eigen makes a slow loop of its own.
template <typename Real> Eigen::MatrixXcd real_times(const Eigen::MatrixBase<Real>& A, const Eigen::MatrixXcd& x)
{
  Eigen::MatrixXcd result(A.rows(), x.cols());
  result.real() = A * x.real();
  result.imag() = A * x.imag();
  return result;
}

/// The real parts of all columns, then the imaginary ones.
Eigen::MatrixXd parts_of(const Eigen::MatrixXcd& x);

/// A^-1 B by LU with row interchanges. Throws Error with the text `singular` if a pivot is zero.
Eigen::MatrixXd solve_dense(Eigen::MatrixXd A, const Eigen::MatrixXd& B, const char* singular);
/// Replaces B by A^-1 B.
void solve_dense_in_place(Eigen::MatrixXd A, Eigen::Ref<Eigen::MatrixXd> B, const char* singular);

/// An orthonormal basis of the span of independent columns.
Eigen::MatrixXd orthonormal_columns(const Eigen::MatrixXd& A);

// Eigenproblems of dense matrices, solved by Eigen with LAPACK underneath (src/README.md, section 8.8). Matrices are
// square; `Matrix` is Eigen::MatrixXd or MatrixXcd. Functions whose name ends in _shared are collective; the others
// work on one rank alone. Where LAPACK does not converge they throw Error.

/// An eigenvalue with its vectors: Q(lambda) right = 0, left' Q(lambda) = 0, Q = A - lambda or lambda^2 M + lambda C +
/// K; the prime transposes without conjugation. 2-norms are 1. Q may have loss factors too (dense_losses.hpp).
struct DenseEigenpair
{
  std::complex<double> lambda;
  Eigen::VectorXcd right, left{}; // without entries: not asked for
};

/// The vectors of one side as columns; empty without pairs.
Eigen::MatrixXcd vectors_of(std::span<const DenseEigenpair> pairs, Eigen::VectorXcd DenseEigenpair::*side);

/// Gives every rank the pairs of rank 0, whose vectors have so many rows. Collective.
void share(MPI_Comm comm, std::vector<DenseEigenpair>& pairs, Eigen::Index rows);

/// The vectors of pairs that are wanted.
enum class Vectors
{
  right,
  both,
};

/// The pairs of lambda^2 M + lambda C + K with Im(lambda) >= 0 and finite |lambda| <= limit, from the matrices of rank
/// 0, on every rank. M, C and K are of one size and not symmetric in general. Collective.
template <class Matrix> std::vector<DenseEigenpair> solve_dense_quadratic_shared(MPI_Comm comm, const Matrix& M,
                                                                                 const Matrix& C, const Matrix& K,
                                                                                 Vectors which = Vectors::right,
                                                                                 double limit = HUGE_VAL);

/// All eigenpairs of A, the largest modulus first, of a complex pair first the one with Im(lambda) > 0.
std::vector<DenseEigenpair> solve_dense_unsymmetric(const Eigen::MatrixXd& A);

/// Real columns that span the pairs' vectors, which have `size` entries. There is one column a pair: the real part
/// where Im(lambda) >= 0, the imaginary part of the other one.
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
