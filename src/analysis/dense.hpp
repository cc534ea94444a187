#pragma once
/// Tall matrices: few columns of distributed vectors, dense, and what small matrices are made of them.
#include "squeal/base/petsc.hpp"

#include <Eigen/Dense>

namespace squeal
{

/// `columns` zero columns of the layout of A's rows.
Owned<Mat> tall(Mat A, PetscInt columns);

void set_column(Mat columns, PetscInt index, Vec values);
Owned<Vec> column_of(Mat columns, PetscInt index);

/// A X, A sparse.
Owned<Mat> times(Mat A, Mat X);

/// X Y, Y small and the same on every rank.
Owned<Mat> combine(Mat X, const Eigen::MatrixXd& Y);

/// target -= X Y
void subtract(Mat target, Mat X, const Eigen::MatrixXd& Y);

/// X'Y, the same on every rank. Collective.
Eigen::MatrixXd gram(Mat X, Mat Y);

/// [X Y]
Owned<Mat> beside(Mat X, Mat Y);

/// The transpose of a sparse matrix of few rows.
Owned<Mat> tall_transpose(Mat A);

} // namespace squeal
