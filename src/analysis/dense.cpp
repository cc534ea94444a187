#include "dense.hpp"

#include <petscblaslapack.h>

namespace squeal
{

namespace
{

/// This rank's rows of a tall matrix, column-major; its leading dimension is the number of rows.
struct Rows
{
  explicit Rows(Mat matrix) : owner(matrix)
  {
    PetscInt rows = 0, columns = 0, leading = 0;
    check(MatGetLocalSize(matrix, &rows, nullptr));
    check(MatGetSize(matrix, nullptr, &columns));
    check(MatDenseGetLDA(matrix, &leading));
    check(MatDenseGetArray(matrix, &values));
    count = static_cast<PetscBLASInt>(rows);
    width = static_cast<PetscBLASInt>(columns);
    stride = static_cast<PetscBLASInt>(leading);
  }
  ~Rows() { (void)MatDenseRestoreArray(owner, &values); }
  Rows(const Rows&) = delete;
  Rows& operator=(const Rows&) = delete;

  Mat owner;
  double* values = nullptr;
  PetscBLASInt count = 0, width = 0, stride = 0;
};

/// target = factor target + sign X Y
void multiply(const Rows& X, const Eigen::MatrixXd& Y, double sign, double factor, const Rows& target)
{
  const auto inner = X.width, columns = static_cast<PetscBLASInt>(Y.cols());
  if (X.count > 0 && inner > 0 && columns > 0)
    BLASgemm_("N", "N", &X.count, &columns, &inner, &sign, X.values, &X.stride, Y.data(), &inner, &factor,
              target.values, &target.stride);
}

} // namespace

Owned<Mat> tall(Mat A, PetscInt columns)
{
  PetscInt rows = 0;
  check(MatGetLocalSize(A, &rows, nullptr));
  Owned<Mat> result;
  check(MatCreateDense(comm_of(A), rows, PETSC_DECIDE, PETSC_DETERMINE, columns, nullptr, result.put()));
  check(MatAssemblyBegin(result, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(result, MAT_FINAL_ASSEMBLY));
  return result;
}

void set_column(Mat columns, PetscInt index, Vec values)
{
  Vec column = nullptr;
  check(MatDenseGetColumnVecWrite(columns, index, &column));
  check(VecCopy(values, column));
  check(MatDenseRestoreColumnVecWrite(columns, index, &column));
}

Owned<Vec> column_of(Mat columns, PetscInt index)
{
  Vec column = nullptr;
  check(MatDenseGetColumnVecRead(columns, index, &column));
  Owned<Vec> result = copy_of(column);
  check(MatDenseRestoreColumnVecRead(columns, index, &column));
  return result;
}

Owned<Mat> times(Mat A, Mat X)
{
  Owned<Mat> result;
  check(MatMatMult(A, X, MAT_INITIAL_MATRIX, PETSC_DEFAULT, result.put()));
  return result;
}

Owned<Mat> combine(Mat X, const Eigen::MatrixXd& Y)
{
  Owned<Mat> result = tall(X, static_cast<PetscInt>(Y.cols()));
  multiply(Rows(X), Y, 1, 0, Rows(result));
  return result;
}

void subtract(Mat target, Mat X, const Eigen::MatrixXd& Y)
{
  multiply(Rows(X), Y, -1, 1, Rows(target));
}

Eigen::MatrixXd gram(Mat X, Mat Y)
{
  const Rows x(X), y(Y);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(x.width, y.width);
  const double one = 1, zero = 0;
  if (x.count > 0 && result.size() > 0)
    BLASgemm_("T", "N", &x.width, &y.width, &x.count, &one, x.values, &x.stride, y.values, &y.stride, &zero,
              result.data(), &x.width);
  // to one and from there to all: the last bit is everybody's, too
  const auto size = static_cast<int>(result.size());
  const bool here = rank_of(comm_of(X)) == 0;
  MPI_Reduce(here ? MPI_IN_PLACE : result.data(), result.data(), size, MPI_DOUBLE, MPI_SUM, 0, comm_of(X));
  MPI_Bcast(result.data(), size, MPI_DOUBLE, 0, comm_of(X));
  return result;
}

Owned<Mat> beside(Mat X, Mat Y)
{
  PetscInt first = 0, second = 0;
  check(MatGetSize(X, nullptr, &first));
  check(MatGetSize(Y, nullptr, &second));
  Owned<Mat> result = tall(X, first + second);
  const Rows x(X), y(Y), target(result);
  for (PetscBLASInt j = 0; j < x.width; ++j)
    std::copy_n(x.values + static_cast<std::ptrdiff_t>(j) * x.stride, x.count,
                target.values + static_cast<std::ptrdiff_t>(j) * target.stride);
  for (PetscBLASInt j = 0; j < y.width; ++j)
    std::copy_n(y.values + static_cast<std::ptrdiff_t>(j) * y.stride, y.count,
                target.values + static_cast<std::ptrdiff_t>(x.width + j) * target.stride);
  return result;
}

Owned<Mat> tall_transpose(Mat A)
{
  Owned<Mat> transposed, result;
  check(MatTranspose(A, MAT_INITIAL_MATRIX, transposed.put()));
  check(MatConvert(transposed, MATDENSE, MAT_INITIAL_MATRIX, result.put()));
  return result;
}

} // namespace squeal
