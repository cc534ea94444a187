#include "eigenvectors.hpp"

#include "squeal/base/error.hpp"

#include <algorithm>
#include <Eigen/Eigenvalues>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

template <class Complexes> lapack_complex_double* entries_of(Complexes& A)
{
  return reinterpret_cast<lapack_complex_double*>(A.data());
}

/// Reorders a Schur form by LAPACK's trsen, since Eigen has no such function, and reads the eigenvalues from it.
bool order_and_read(SchurForm& schur, const std::vector<lapack_logical>& chosen)
{
  const int n = to_int(schur.T.rows());
  VectorXd real(n), imaginary(n), work(std::max(1, n));
  int count = 0, integers = 0;
  double condition = 0, separation = 0;
  const int info = LAPACKE_dtrsen_work(LAPACK_COL_MAJOR, 'N', 'V', chosen.data(), n, schur.T.data(), n, schur.Q.data(),
                                       n, real.data(), imaginary.data(), &count, &condition, &separation, work.data(),
                                       to_int(work.size()), &integers, 1);
  schur.eigenvalues.clear();
  for (Index i = 0; i < n; ++i) schur.eigenvalues.emplace_back(real(i), imaginary(i));
  return info == 0;
}

/// Vectors from LAPACK's columns for a real matrix: of conjugates the first one is the real part and the next one the
/// imaginary part of the vector with Im(mu) > 0.
MatrixXcd complex_columns(const VectorXcd& mu, const MatrixXd& packed)
{
  MatrixXcd columns = packed.cast<Complex>();
  for (Index j = 0; j + 1 < columns.cols(); ++j)
    if (mu(j).imag() > 0)
    {
      columns.col(j).imag() = packed.col(j + 1);
      columns.col(j + 1) = columns.col(j).conjugate();
      ++j;
    }
  return columns;
}

/// The letters and the columns that LAPACK's geev takes for left and right vectors.
struct Wanted
{
  char left, right;
  Index left_columns, right_columns;
};

Wanted wanted(Vectors which, Index size)
{
  const bool left = which == Vectors::both, right = which != Vectors::none;
  return {left ? 'V' : 'N', right ? 'V' : 'N', left ? size : 0, right ? size : 0};
}

void need_convergence(int info)
{
  if (info != 0) throw Error("the QR algorithm did not converge on a dense eigenproblem");
}

} // namespace

Eigenvectors eigenvectors(MatrixXd A, Vectors which)
{
  const int size = to_int(A.rows());
  const Wanted job = wanted(which, size);
  VectorXd re(size), im(size);
  MatrixXd left(size, job.left_columns), right(size, job.right_columns);
  need_convergence(LAPACKE_dgeev(LAPACK_COL_MAJOR, job.left, job.right, size, A.data(), size, re.data(), im.data(),
                                 left.data(), size, right.data(), size));
  const VectorXcd mu = re.cast<Complex>() + Complex(0, 1) * im;
  return {mu, complex_columns(mu, left), complex_columns(mu, right)};
}

Eigenvectors eigenvectors(MatrixXcd A, Vectors which)
{
  const int size = to_int(A.rows());
  const Wanted job = wanted(which, size);
  Eigenvectors all{VectorXcd(size), MatrixXcd(size, job.left_columns), MatrixXcd(size, job.right_columns)};
  need_convergence(LAPACKE_zgeev(LAPACK_COL_MAJOR, job.left, job.right, size, entries_of(A), size, entries_of(all.mu),
                                 entries_of(all.left), size, entries_of(all.right), size));
  return all;
}

std::optional<SchurForm> schur_form(const MatrixXd& A)
{
  const Eigen::RealSchur<MatrixXd> solver(A);
  if (solver.info() != Eigen::Success) return std::nullopt;
  SchurForm schur{solver.matrixT(), solver.matrixU(), {}};
  order_and_read(schur, std::vector<lapack_logical>(static_cast<std::size_t>(A.rows()), 0));
  return schur;
}

bool reorder(SchurForm& schur, const std::function<bool(Complex)>& chosen)
{
  std::vector<lapack_logical> marks;
  for (const Complex eigenvalue : schur.eigenvalues) marks.push_back(chosen(eigenvalue));
  return order_and_read(schur, marks);
}

} // namespace squeal
