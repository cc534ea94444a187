#include "squeal/algebra/dense_matrix.hpp"

#include "squeal/base/error.hpp"

#include <Eigen/LU>
#include <Eigen/QR>

namespace squeal
{

using Eigen::MatrixXd;

MatrixXd dense_copy(Mat A)
{
  PetscInt rows = 0, columns = 0;
  check(MatGetSize(A, &rows, &columns));
  Owned<IS> all_rows, all_columns;
  check(ISCreateStride(PETSC_COMM_SELF, rows, 0, 1, all_rows.put()));
  check(ISCreateStride(PETSC_COMM_SELF, columns, 0, 1, all_columns.put()));
  const IS row_set = all_rows, column_set = all_columns;
  Mat* parts = nullptr;
  check(MatCreateSubMatrices(A, 1, &row_set, &column_set, MAT_INITIAL_MATRIX, &parts));
  MatrixXd result = MatrixXd::Zero(rows, columns);
  for_each_row(parts[0],
               [&](PetscInt i, std::span<const PetscInt> column, std::span<const PetscScalar> value)
               {
                 for (std::size_t k = 0; k < column.size(); ++k) result(i, column[k]) = value[k];
               });
  check(MatDestroySubMatrices(1, &parts));
  return result;
}

namespace
{

Share share_of(Eigen::Index count, int rank, int ranks)
{
  const Eigen::Index first = count * rank / ranks;
  return {first, count * (rank + 1) / ranks - first};
}

} // namespace

Share share_of(Eigen::Index count, MPI_Comm comm)
{
  return share_of(count, rank_of(comm), ranks_of(comm));
}

void gather_shares(double* values, Eigen::Index count, Eigen::Index length, MPI_Comm comm)
{
  const int ranks = ranks_of(comm);
  if (ranks == 1) return;
  std::vector<int> firsts, counts;
  for (int rank = 0; rank < ranks; ++rank)
  {
    const Share share = share_of(count, rank, ranks);
    firsts.push_back(to_int(share.first * length));
    counts.push_back(to_int(share.count * length));
  }
  MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DOUBLE, values, counts.data(), firsts.data(), MPI_DOUBLE, comm);
}

void gather_columns(MatrixXd& A, MPI_Comm comm)
{
  gather_shares(A.data(), A.cols(), A.rows(), comm);
}

MatrixXd parts_of(const Eigen::MatrixXcd& x)
{
  MatrixXd parts(x.rows(), 2 * x.cols());
  parts << x.real(), x.imag();
  return parts;
}

MatrixXd solve_dense(MatrixXd A, const MatrixXd& B, const char* singular)
{
  MatrixXd X = B;
  solve_dense_in_place(std::move(A), X, singular);
  return X;
}

void solve_dense_in_place(MatrixXd A, Eigen::Ref<MatrixXd> B, const char* singular)
{
  if (A.size() == 0) return;
  if (!A.allFinite()) throw Error(singular); // LAPACK would return without the permutation that Eigen then applies
  const Eigen::PartialPivLU<Eigen::Ref<MatrixXd>> factor(A);
  if ((factor.matrixLU().diagonal().array() == 0).any()) throw Error(singular);
  B = factor.solve(B);
}

MatrixXd orthonormal_columns(const MatrixXd& A)
{
  const Eigen::HouseholderQR<MatrixXd> qr(A);
  return qr.householderQ() * MatrixXd::Identity(A.rows(), A.cols());
}

} // namespace squeal
