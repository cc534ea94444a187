#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <numeric>
#include <utility>

namespace squeal
{

MatrixXd dense_copy(Mat A)
{
  const PetscInt rows = row_count(A), columns = column_count(A);
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

namespace
{

using Eigen::MatrixXcd;
using Eigen::VectorXcd;

/// Eigenvalues mu of a matrix with their vectors as columns. Left ones u obey u^H A = mu u^H.
struct Eigenvectors
{
  Eigen::VectorXcd mu;
  Eigen::MatrixXcd left{}, right{}; // without columns: left ones are not wanted
};

template <class Complexes> lapack_complex_double* entries_of(Complexes& A)
{
  return reinterpret_cast<lapack_complex_double*>(A.data());
}

/// Vectors from LAPACK's columns for a real matrix. Of conjugates the first one is the real part of the vector with
/// Im(mu) > 0, the next one its imaginary part.
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

void need_convergence(int info)
{
  if (info != 0) throw Error("the QR algorithm did not converge on a dense eigenproblem");
}

/// Finds them by LAPACK. Error: the QR algorithm does not converge.
Eigenvectors eigenvectors(MatrixXd A, Vectors which)
{
  const int size = to_int(A.rows());
  const Index columns = which == Vectors::both ? size : 0;
  VectorXd re(size), im(size);
  MatrixXd left(size, columns), right(size, size);
  need_convergence(LAPACKE_dgeev(LAPACK_COL_MAJOR, which == Vectors::both ? 'V' : 'N', 'V', size, A.data(), size,
                                 re.data(), im.data(), left.data(), size, right.data(), size));
  const VectorXcd mu = re.cast<Complex>() + Complex(0, 1) * im;
  return {mu, complex_columns(mu, left), complex_columns(mu, right)};
}

Eigenvectors eigenvectors(MatrixXcd A, Vectors which)
{
  const int size = to_int(A.rows());
  Eigenvectors all{VectorXcd(size), MatrixXcd(size, which == Vectors::both ? size : 0), MatrixXcd(size, size)};
  need_convergence(LAPACKE_zgeev(LAPACK_COL_MAJOR, which == Vectors::both ? 'V' : 'N', 'V', size, entries_of(A), size,
                                 entries_of(all.mu), entries_of(all.left), size, entries_of(all.right), size));
  return all;
}

template <class Matrix> double norm_1(const Matrix& A)
{
  return A.size() > 0 ? A.cwiseAbs().colwise().sum().maxCoeff() : 0;
}

/// LU with row interchanges. Throws Error with the text `singular` if a pivot is zero.
template <class Matrix> Eigen::PartialPivLU<Matrix> regular_factor(const Matrix& A, const char* singular)
{
  if (!A.allFinite()) throw Error(singular); // LAPACK would return without the permutation that Eigen then applies
  Eigen::PartialPivLU<Matrix> factor(A);
  if ((factor.matrixLU().diagonal().cwiseAbs().array() == 0).any()) throw Error(singular);
  return factor;
}

/// The pairs of a quadratic problem with Im(lambda) >= 0 and |lambda| <= limit, and the wanted vectors.
///
/// With lambda = omega nu, nu = shift + 1/mu and Q = Q(shift) of the scaled matrices, Q mu^2 + (C + 2 shift M) mu + M
/// is singular. Its companion matrix is [-Q^-1 (C + 2 shift M), -Q^-1 M; I, 0] on (mu y, y). Left vectors of the
/// quadratic problem are Q^-T conj(a) by those (a, b) of the companion matrix.
template <class Matrix> std::vector<DenseEigenpair> solve_companion(const Matrix& M, const Matrix& C, const Matrix& K,
                                                                    Vectors which, double limit)
{
  std::vector<DenseEigenpair> result;
  const Index n = K.rows();
  const double stiffness = norm_1(K), mass = norm_1(M);
  if (mass == 0 || stiffness == 0) return result;
  const double largest = std::sqrt(stiffness / mass); // far above all eigenvalues a limit is no scale
  const bool all = !(limit < largest);
  const double omega = all ? largest : limit;
  const double shift = all ? 1e-2 : 0.2; // of nu: any that is no eigenvalue
  const Matrix m = omega * omega / stiffness * M, c = omega / stiffness * C, k = K / stiffness;
  const Matrix Q = k + shift * (c + shift * m);
  const auto factor =
      regular_factor(Q, "the quadratic eigenproblem is singular: some motion has neither mass nor stiffness");
  Matrix A = Matrix::Zero(2 * n, 2 * n);
  A.topLeftCorner(n, n) = factor.solve(-c - 2 * shift * m);
  A.topRightCorner(n, n) = factor.solve(-m);
  A.bottomLeftCorner(n, n).setIdentity();
  const auto [mu, left, right] = eigenvectors(std::move(A), which);
  std::vector<Index> chosen;
  for (Index j = 0; j < mu.size(); ++j) // Im(lambda) >= 0, and lambda is finite: it is not without mass
    if (mu(j).imag() <= 0 && std::abs(mu(j)) >= 1e-12 && !(omega * std::abs(shift + 1.0 / mu(j)) > limit))
      chosen.push_back(j);
  MatrixXcd chi;
  if (left.cols() > 0)
    chi = MatrixXcd(Q.template cast<Complex>())
              .transpose()
              .partialPivLu()
              .solve(left(Eigen::seqN(0, n), chosen).conjugate());
  for (Index place = 0; const Index j : chosen)
  {
    DenseEigenpair& pair = result.emplace_back();
    pair.lambda = omega * (shift + 1.0 / mu(j));
    // of mu y and y the one of larger entries
    pair.right = right.col(j).segment(std::abs(mu(j)) > 1 ? 0 : n, n).normalized();
    if (left.cols() > 0) pair.left = chi.col(place++).normalized();
  }
  return result;
}

} // namespace

Eigen::MatrixXcd vectors_of(std::span<const DenseEigenpair> pairs, Eigen::VectorXcd DenseEigenpair::*side)
{
  if (pairs.empty()) return {};
  Eigen::MatrixXcd vectors((pairs.front().*side).size(), static_cast<Index>(pairs.size()));
  for (Index column = 0; const DenseEigenpair& pair : pairs) vectors.col(column++) = pair.*side;
  return vectors;
}

void share(MPI_Comm comm, std::vector<DenseEigenpair>& pairs, Index rows)
{
  int counts[2] = {to_int(pairs.size()), !pairs.empty() && pairs.front().left.size() > 0};
  MPI_Bcast(counts, 2, MPI_INT, 0, comm);
  pairs.resize(static_cast<std::size_t>(counts[0]));
  for (DenseEigenpair& pair : pairs)
  {
    MPI_Bcast(&pair.lambda, 1, MPI_CXX_DOUBLE_COMPLEX, 0, comm);
    for (Eigen::VectorXcd* vector : {&pair.right, &pair.left})
    {
      vector->resize(vector == &pair.right || counts[1] ? rows : 0);
      MPI_Bcast(vector->data(), to_int(vector->size()), MPI_CXX_DOUBLE_COMPLEX, 0, comm);
    }
  }
}

template <class Matrix> std::vector<DenseEigenpair> solve_dense_quadratic_shared(MPI_Comm comm, const Matrix& M,
                                                                                 const Matrix& C, const Matrix& K,
                                                                                 Vectors which, double limit)
{
  std::vector<DenseEigenpair> pairs;
  on_rank_zero(comm, [&] { pairs = solve_companion(M, C, K, which, limit); });
  share(comm, pairs, K.rows());
  return pairs;
}

SymmetricEigenpairs solve_dense_symmetric(MatrixXd A)
{
  VectorXd lambda(A.rows());
  const int size = to_int(A.rows());
  if (size > 0 && LAPACKE_dsyevd(LAPACK_COL_MAJOR, 'V', 'L', size, A.data(), size, lambda.data()) != 0)
    throw Error("the eigenvalues of a symmetric matrix did not converge");
  return {std::move(lambda), std::move(A)};
}

SymmetricEigenpairs solve_dense_symmetric(const MatrixXd& M, const MatrixXd& K, double shift)
{
  // M y = theta (K - shift M) y with theta = 1/(lambda - shift) allows a singular M. With K - shift M = L L' it is
  // L^-1 M L^-T z = theta z.
  if (K.rows() == 0) return {};
  const Eigen::LLT<MatrixXd> factor(K - shift * M);
  if (factor.info() != Eigen::Success)
    throw Error("the real modes fail: stiffness is not positive semidefinite, or some motion has neither "
                "mass nor stiffness");
  const MatrixXd half = factor.matrixL().solve(M);
  const SymmetricEigenpairs pairs = solve_dense_symmetric(factor.matrixL().solve(half.transpose()));
  const VectorXd theta = pairs.lambda.reverse();
  const Index finite = (theta.array() > 1e-14 * theta(0)).count();
  const VectorXd kept = theta.head(finite);
  return {(shift + kept.array().inverse()).matrix(),
          factor.matrixU().solve(pairs.y.rowwise().reverse().leftCols(finite)) *
              kept.cwiseSqrt().cwiseInverse().asDiagonal()};
}

SymmetricEigenpairs solve_dense_symmetric_shared(MPI_Comm comm, const MatrixXd& M, const MatrixXd& K, double shift)
{
  SymmetricEigenpairs pairs;
  on_rank_zero(comm, [&] { pairs = solve_dense_symmetric(M, K, shift); });
  broadcast(pairs.lambda, comm);
  broadcast(pairs.y, comm);
  return pairs;
}

std::vector<DenseEigenpair> solve_dense_unsymmetric(const MatrixXd& A)
{
  std::vector<DenseEigenpair> pairs;
  if (A.rows() == 0) return pairs;
  const auto [mu, left, right] = eigenvectors(A, Vectors::right);
  for (Index i = 0; i < mu.size(); ++i)
    pairs.push_back({mu(i), right.col(i).normalized()}); // conjugates are neighbours
  std::ranges::stable_sort(pairs, std::greater{}, [](const DenseEigenpair& pair) { return std::abs(pair.lambda); });
  return pairs;
}

Eigen::MatrixXd real_columns(const std::vector<DenseEigenpair>& pairs, Eigen::Index size)
{
  Eigen::MatrixXd result(size, static_cast<Eigen::Index>(pairs.size()));
  for (Eigen::Index i = 0; i < result.cols(); ++i)
  {
    const DenseEigenpair& pair = pairs[static_cast<std::size_t>(i)];
    result.col(i) = pair.lambda.imag() < 0 ? Eigen::VectorXd(-pair.right.imag()) : Eigen::VectorXd(pair.right.real());
  }
  return result;
}

std::vector<std::complex<double>> values_of(const std::vector<DenseEigenpair>& pairs)
{
  std::vector<std::complex<double>> values;
  for (const DenseEigenpair& pair : pairs) values.push_back(pair.lambda);
  return values;
}

std::vector<std::size_t> nearest_places(const std::vector<std::complex<double>>& references,
                                        const std::vector<std::complex<double>>& values)
{
  std::vector<std::size_t> places(values.size());
  std::iota(places.begin(), places.end(), 0U);
  const auto distance = [&](std::size_t reference, std::size_t place) // those beyond the references stay unmatched
  { return reference < references.size() ? std::abs(values[place] - references[reference]) : 0; };
  for (std::size_t i = 0; i < references.size(); ++i)
    for (std::size_t k = i + 1; k < values.size(); ++k)
      if (distance(i, places[k]) < distance(i, places[i])) std::swap(places[i], places[k]);
  // an early reference may have taken what a later one needs more
  const auto exchange = [&](std::size_t i, std::size_t k)
  {
    const double now = distance(i, places[i]) + distance(k, places[k]);
    if (!(distance(i, places[k]) + distance(k, places[i]) < now * (1 - 1e-12))) return false;
    std::swap(places[i], places[k]);
    return true;
  };
  for (bool exchanged = true; exchanged;)
  {
    exchanged = false;
    for (std::size_t i = 0; i < references.size(); ++i)
      for (std::size_t k = i + 1; k < values.size(); ++k) exchanged = exchange(i, k) || exchanged;
  }
  places.resize(references.size());
  return places;
}

template std::vector<DenseEigenpair> solve_dense_quadratic_shared(MPI_Comm, const MatrixXd&, const MatrixXd&,
                                                                  const MatrixXd&, Vectors, double);
template std::vector<DenseEigenpair> solve_dense_quadratic_shared(MPI_Comm, const MatrixXcd&, const MatrixXcd&,
                                                                  const MatrixXcd&, Vectors, double);

} // namespace squeal
