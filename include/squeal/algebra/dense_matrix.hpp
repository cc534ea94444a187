#pragma once
/// Dense matrices that are whole on one rank or on all: copies, broadcasts and linear systems.
#include "squeal/base/petsc.hpp"

#include <Eigen/Core>

namespace squeal
{

/// All entries of A on every rank. Collective.
Eigen::MatrixXd dense_copy(Mat A);

/// Gives every rank the size and the entries that rank 0 has. Collective.
void broadcast(Eigen::MatrixXd& A, MPI_Comm comm);
/// The same of a vector. Collective.
void broadcast(Eigen::VectorXd& x, MPI_Comm comm);

/// A^-1 B by LU with row interchanges. Throws Error with the text `singular` if a pivot is zero.
Eigen::MatrixXd solve_dense(Eigen::MatrixXd A, const Eigen::MatrixXd& B, const char* singular);

/// An orthonormal basis of the span of independent columns.
Eigen::MatrixXd orthonormal_columns(const Eigen::MatrixXd& A);

} // namespace squeal
