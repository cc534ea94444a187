#pragma once
/// Distributed vectors side by side: a sparse matrix is read once for every sixteen of them, and products among them
/// are dense matrix products. Every function is collective; small matrices are whole on every rank.
#include "squeal/base/dense.hpp"
#include "squeal/base/petsc.hpp"

#include <functional>
#include <span>

namespace squeal
{

/// Vectors as the columns of a matrix.
struct MultiVector
{
  MPI_Comm comm = MPI_COMM_NULL;
  Eigen::MatrixXd entries{}; // rows of this rank, one column for each vector

  Eigen::Index columns() const { return entries.cols(); }
};

/// No vectors yet, rows distributed as the columns of A.
MultiVector empty_multivector(Mat A);

/// Pseudo-random entries in (-1, 1), the same for any number of ranks.
MultiVector random_multivector(Mat A, PetscInt columns);

/// Copies of at least one vector.
MultiVector columns_of(std::span<const Vec> x);

/// Appends a vector, or all columns of Y, with rows distributed as those of X.
void append(MultiVector& X, Vec x);
void append(MultiVector& X, const MultiVector& Y);
/// x = column j of X.
void copy_column(const MultiVector& X, Eigen::Index j, Vec x);

/// A X
MultiVector product(Mat A, const MultiVector& X);

/// A X of a matrix of few rows, whole on every rank.
Eigen::MatrixXd whole_product(Mat A, const MultiVector& X);

/// y_k = A x_k for all k.
void product(Mat A, std::span<const Vec> x, std::span<const Vec> y);

/// X a
MultiVector combination(const MultiVector& X, const Eigen::MatrixXd& a);

/// X a in place of X, for a of no more columns than rows: X is never held twice.
void combine(MultiVector& X, const Eigen::MatrixXd& a);

/// The columns of X from `first` on.
MultiVector columns_from(const MultiVector& X, Eigen::Index first);

/// X'Y, the same to the last bit on every rank.
Eigen::MatrixXd inner_products(const MultiVector& X, const MultiVector& Y);

/// X'Y where it is symmetric, as X'A X: half the work.
Eigen::MatrixXd symmetric_inner_products(const MultiVector& X, const MultiVector& Y);

/// X'A X of a symmetric A. A X is formed some columns at a time, which `visit` is shown from their first one on.
Eigen::MatrixXd
symmetric_inner_products(const MultiVector& X, Mat A,
                         const std::function<void(Eigen::Index first, const MultiVector& image)>& visit = {});

/// 2-norms of the columns.
Eigen::VectorXd column_norms(const MultiVector& X);

/// Replaces X by an orthonormal basis of its span, without the directions whose eigenvalue of X'X is below `least`
/// times the largest.
void orthonormalise(MultiVector& X, double least);

/// Appends to the orthonormal V an orthonormal basis of what X adds to its span. A part of X below 1e-12 of its column
/// counts as nothing. Returns the number of columns that V gains.
Eigen::Index extend_orthonormal(MultiVector& V, MultiVector X);

} // namespace squeal
