/// Times Eigen over the machine's LAPACK beside direct calls of LAPACK, for the dense problems that squeal solves: the
/// nonsymmetric eigenproblem (geev), a linear system with as many right-hand sides as rows (gesv) and the symmetric
/// definite eigenproblem (sygv). Prints median processor seconds of both and their ratio.
#include "bench_timing.hpp"
#include "squeal/algebra/dense_matrix.hpp"

#include <cstdio>
#include <Eigen/Eigenvalues>
#include <functional>

using namespace squeal;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace
{

void geev(MatrixXd A)
{
  const int n = static_cast<int>(A.rows());
  VectorXd real(n), imaginary(n);
  MatrixXd left(1, 1), right(n, n);
  LAPACKE_dgeev(LAPACK_COL_MAJOR, 'N', 'V', n, A.data(), n, real.data(), imaginary.data(), left.data(), 1, right.data(),
                n);
}

void gesv(MatrixXd A, MatrixXd B)
{
  const int n = static_cast<int>(A.rows());
  std::vector<int> pivots(static_cast<std::size_t>(n));
  LAPACKE_dgesv(LAPACK_COL_MAJOR, n, static_cast<int>(B.cols()), A.data(), n, pivots.data(), B.data(), n);
}

void sygv(MatrixXd A, MatrixXd B)
{
  const int n = static_cast<int>(A.rows());
  VectorXd values(n);
  LAPACKE_dsygv(LAPACK_COL_MAJOR, 1, 'V', 'U', n, A.data(), n, B.data(), n, values.data());
}

void compare(const char* name, const MatrixXd& A, const std::function<void()>& lapack,
             const std::function<void()>& eigen)
{
  const int times = A.rows() > 400 ? 3 : 7;
  const double direct = seconds(times, lapack), ours = seconds(times, eigen);
  std::printf("%-6s n = %4d   LAPACK %.4f s   Eigen %.4f s   ratio %.2f\n", name, static_cast<int>(A.rows()), direct,
              ours, ours / direct);
  std::fflush(stdout);
}

} // namespace

int main(int argc, char** argv)
{
  const Session session(argc, argv, nullptr);
  for (const int n : {50, 200, 400, 800, 1600})
  {
    const MatrixXd A = MatrixXd::Random(n, n), M = A * A.transpose() / n + MatrixXd::Identity(n, n);
    const MatrixXd K = 2 * M + A * A.transpose();
    compare(
        "geev", A, [&] { geev(A); }, [&] { (void)Eigen::EigenSolver<MatrixXd>(A).pseudoEigenvectors(); });
    compare(
        "gesv", A, [&] { gesv(A, M); }, [&] { (void)solve_dense(A, M, "singular"); });
    if (n <= 800)
      compare(
          "sygv", A, [&] { sygv(M, K + 0.1 * M); }, [&] { (void)solve_dense_symmetric(M, K, -0.1); });
  }
}
