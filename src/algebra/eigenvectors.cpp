#include "eigenvectors.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/integers.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <random>

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

bool order_and_read(SchurFormOf<MatrixXcd>& schur, const std::vector<lapack_logical>& chosen)
{
  const int n = to_int(schur.T.rows());
  VectorXcd values(n), work(std::max(1, n));
  int count = 0;
  double condition = 0, separation = 0;
  const int info =
      LAPACKE_ztrsen_work(LAPACK_COL_MAJOR, 'N', 'V', chosen.data(), n, entries_of(schur.T), n, entries_of(schur.Q), n,
                          entries_of(values), &count, &condition, &separation, entries_of(work), to_int(work.size()));
  schur.eigenvalues.assign(values.begin(), values.end());
  return info == 0;
}

template <class Solver, class Matrix> std::optional<SchurFormOf<Matrix>> schur_form_by(const Matrix& A)
{
  const Solver solver(A);
  if (solver.info() != Eigen::Success) return std::nullopt;
  SchurFormOf<Matrix> schur{solver.matrixT(), solver.matrixU(), {}};
  order_and_read(schur, std::vector<lapack_logical>(static_cast<std::size_t>(A.rows()), 0));
  return schur;
}

/// Moves the chosen eigenvalues to the front.
template <class Form> bool reorder_chosen(Form& schur, const std::function<bool(Complex)>& chosen)
{
  std::vector<lapack_logical> marks;
  for (const Complex eigenvalue : schur.eigenvalues) marks.push_back(chosen(eigenvalue));
  return order_and_read(schur, marks);
}

std::optional<SchurForm> schur_form_of(const MatrixXd& A)
{
  return schur_form_by<Eigen::RealSchur<MatrixXd>>(A);
}

std::optional<SchurFormOf<MatrixXcd>> schur_form_of(const MatrixXcd& A)
{
  return schur_form_by<Eigen::ComplexSchur<MatrixXcd>>(A);
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

template <class Matrix> Matrix orthonormal(const Matrix& A)
{
  return Eigen::HouseholderQR<Matrix>(A).householderQ() * Matrix::Identity(A.rows(), A.cols());
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

namespace
{

/// An orthonormal basis of the invariant subspace of those eigenvalues whose modulus is `edge` or more, by block
/// Arnoldi without restarts. Nothing if it takes more than half of all columns: then the whole problem takes no longer.
template <class Matrix> std::optional<Matrix> dominant_subspace(const Matrix& A, double edge)
{
  constexpr Index in_block = 4; // rounding brings in eigenvalues that coincide more often, only later
  constexpr Index first = 128;  // columns that are tested first: smaller spaces take no time
  constexpr Index usual = 4;    // times the subspace, at least, is what a space takes to have it
  constexpr double invariant = 1e-14;
  const Index n = A.rows(), most = n / 2;
  if (most < first) return std::nullopt;
  std::mt19937_64 generator(1);
  std::normal_distribution<double> normal;
  Matrix Q = orthonormal(Matrix(Matrix::NullaryExpr(n, in_block, [&] { return normal(generator); }))), AQ(n, 0);
  for (Index next = first; next <= most;)
  {
    AQ.conservativeResize(n, Q.cols());
    AQ.rightCols(in_block).noalias() = A * Q.rightCols(in_block);
    Matrix W = AQ.rightCols(in_block);
    for (int time = 0; time < 2; ++time) // once leaves the basis what rounding adds to short vectors
    {
      W -= Q * (Q.adjoint() * W);
      W = orthonormal(W);
    }
    if (Q.cols() >= next)
    {
      next = Q.cols() * 5 / 4;
      auto schur = schur_form_of(Matrix(Q.adjoint() * AQ));
      const auto dominates = [&](Complex mu) { return std::abs(mu) >= edge; };
      const Index wanted = schur ? std::ranges::count_if(schur->eigenvalues, dominates) : 0;
      if (usual * wanted > most) return std::nullopt;
      if (wanted > 0 && reorder_chosen(*schur, dominates))
      {
        const Matrix basis = Q * schur->Q.leftCols(wanted);
        const Matrix left_over = AQ * schur->Q.leftCols(wanted) - basis * schur->T.topLeftCorner(wanted, wanted);
        if (left_over.norm() <= invariant * std::sqrt(static_cast<double>(n)) * schur->T.norm()) return basis;
      }
    }
    Q.conservativeResize(n, Q.cols() + in_block);
    Q.rightCols(in_block) = W;
  }
  return std::nullopt;
}

MatrixXcd times(const MatrixXd& A, const MatrixXcd& x)
{
  return real_times(A, x);
}

MatrixXcd times(const MatrixXcd& A, const MatrixXcd& x)
{
  return A * x;
}

template <class Matrix> Eigenvectors dominant(const Matrix& A, double edge)
{
  constexpr double regular = 1e-10;
  const std::optional<Matrix> right = edge > 0 ? dominant_subspace(A, edge) : std::nullopt;
  if (!right) return eigenvectors(A, Vectors::both);
  const std::optional<Matrix> left = dominant_subspace(Matrix(A.adjoint()), edge);
  if (!left || left->cols() != right->cols()) return eigenvectors(A, Vectors::both);
  const Eigen::PartialPivLU<Matrix> between(left->adjoint() * *right);
  if (!(between.rcond() > regular)) return eigenvectors(A, Vectors::both);
  Eigenvectors small = eigenvectors(Matrix(between.solve(left->adjoint() * (A * *right))), Vectors::both);
  small.right = times(*right, small.right);
  small.left = times(Matrix(between.solve(left->adjoint()).adjoint()), small.left);
  return small;
}

} // namespace

Eigenvectors dominant_eigenvectors(const MatrixXd& A, double edge)
{
  return dominant(A, edge);
}

Eigenvectors dominant_eigenvectors(const MatrixXcd& A, double edge)
{
  return dominant(A, edge);
}

std::optional<SchurForm> schur_form(const MatrixXd& A)
{
  return schur_form_of(A);
}

bool reorder(SchurForm& schur, const std::function<bool(Complex)>& chosen)
{
  return reorder_chosen(schur, chosen);
}

} // namespace squeal
