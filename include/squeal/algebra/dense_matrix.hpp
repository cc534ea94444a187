#pragma once
/// Dense matrices that are whole on one rank or on all: copies, broadcasts, shares and linear systems.
#include "squeal/base/petsc.hpp"

#include <Eigen/Core>

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
/// The same of columns. Collective.
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
/// The same in the place of B.
void solve_dense_in_place(Eigen::MatrixXd A, Eigen::Ref<Eigen::MatrixXd> B, const char* singular);

/// An orthonormal basis of the span of independent columns.
Eigen::MatrixXd orthonormal_columns(const Eigen::MatrixXd& A);

} // namespace squeal
