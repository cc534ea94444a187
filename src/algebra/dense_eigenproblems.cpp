#include "squeal/algebra/dense_eigenproblems.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/integers.hpp"

#include <cmath>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <numeric>
#include <random>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double norm_1(const MatrixXd& A)
{
  return A.cwiseAbs().colwise().sum().maxCoeff();
}

/// With nu = shift + 1/mu and Q = Q(shift),  Q mu^2 + (C + 2 shift M) mu + M = 0. Its companion matrix is
/// [-Q^-1 (C + 2 shift M), -Q^-1 M; I, 0] on (mu y, y).
MatrixXd companion(const MatrixXd& M, const MatrixXd& C, const MatrixXd& K, double shift)
{
  const Index n = K.rows();
  MatrixXd right(n, 2 * n), A(2 * n, 2 * n);
  right << -C - 2 * shift * M, -M;
  A << solve_dense(K + shift * (C + shift * M), right,
                   "the quadratic eigenproblem is singular: some motion has neither mass nor stiffness"),
      MatrixXd::Identity(n, n), MatrixXd::Zero(n, n);
  return A;
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

} // namespace

namespace
{

/// Eigenvalues mu of a real matrix with both vectors as LAPACK has them: of conjugates one column is the real part and
/// the next one the imaginary part. Left ones u obey u^H A = mu u^H.
struct RealEigenvectors
{
  VectorXd re, im;
  MatrixXd left, right;
};

RealEigenvectors all_eigenvectors(MatrixXd A)
{
  const int size = to_int(A.rows());
  RealEigenvectors all{VectorXd(size), VectorXd(size), MatrixXd(size, size), MatrixXd(size, size)};
  if (LAPACKE_dgeev(LAPACK_COL_MAJOR, 'V', 'V', size, A.data(), size, all.re.data(), all.im.data(), all.left.data(),
                    size, all.right.data(), size) != 0)
    throw Error("the QR algorithm did not converge on a dense eigenproblem");
  return all;
}

/// An orthonormal basis of the invariant subspace of those eigenvalues whose modulus is `edge` or more, by block
/// Arnoldi without restarts. Nothing if it takes more than half of all columns: then the whole problem takes no longer.
std::optional<MatrixXd> dominant_subspace(const MatrixXd& A, double edge)
{
  constexpr Index in_block = 4; // rounding brings in eigenvalues that coincide more often, only later
  constexpr Index first = 128;  // columns that are tested first: smaller spaces take no time
  constexpr Index usual = 4;    // times the subspace, at least, is what a space takes to have it
  constexpr double invariant = 1e-14;
  const Index n = A.rows(), most = n / 2;
  if (most < first) return std::nullopt;
  std::mt19937_64 generator(1);
  std::normal_distribution<double> normal;
  MatrixXd Q = orthonormal_columns(MatrixXd::NullaryExpr(n, in_block, [&] { return normal(generator); })), AQ(n, 0);
  for (Index next = first; next <= most;)
  {
    AQ.conservativeResize(n, Q.cols());
    AQ.rightCols(in_block).noalias() = A * Q.rightCols(in_block);
    MatrixXd W = AQ.rightCols(in_block);
    for (int time = 0; time < 2; ++time) // once leaves the basis what rounding adds to short vectors
    {
      W -= Q * (Q.transpose() * W);
      W = orthonormal_columns(W);
    }
    if (Q.cols() >= next)
    {
      next = Q.cols() * 5 / 4;
      std::optional<SchurForm> schur = schur_form(Q.transpose() * AQ);
      const auto dominates = [&](Complex mu) { return std::abs(mu) >= edge; };
      const Index wanted = schur ? std::ranges::count_if(schur->eigenvalues, dominates) : 0;
      if (usual * wanted > most) return std::nullopt;
      if (wanted > 0 && reorder(*schur, dominates))
      {
        const MatrixXd basis = Q * schur->Q.leftCols(wanted);
        const MatrixXd left_over = AQ * schur->Q.leftCols(wanted) - basis * schur->T.topLeftCorner(wanted, wanted);
        if (left_over.norm() <= invariant * std::sqrt(static_cast<double>(n)) * schur->T.norm()) return basis;
      }
    }
    Q.conservativeResize(n, Q.cols() + in_block);
    Q.rightCols(in_block) = W;
  }
  return std::nullopt;
}

/// Those of eigenvalues whose modulus is `edge` or more; of all where they are too many for less work, or one side has
/// others than the other.
RealEigenvectors dominant_eigenvectors(const MatrixXd& A, double edge)
{
  constexpr double regular = 1e-10;
  const std::optional<MatrixXd> right = edge > 0 ? dominant_subspace(A, edge) : std::nullopt;
  if (!right) return all_eigenvectors(A);
  const std::optional<MatrixXd> left = dominant_subspace(A.transpose(), edge);
  if (!left || left->cols() != right->cols()) return all_eigenvectors(A);
  const Eigen::PartialPivLU<MatrixXd> between(left->transpose() * *right);
  if (!(between.rcond() > regular)) return all_eigenvectors(A);
  RealEigenvectors small = all_eigenvectors(between.solve(left->transpose() * (A * *right)));
  small.right = *right * small.right;
  const MatrixXd of_left = between.transpose().solve(small.left);
  small.left = *left * of_left;
  return small;
}

/// (Q mu^2 + (C + 2 shift M) mu + M) y = 0 of the scaled matrices, by LAPACK with the left vectors (a, b) of the
/// companion matrix as well. Those of the quadratic problem are Q^-T a.
std::vector<TwoSidedPair> solve_two_sided(const MatrixXd& M, const MatrixXd& C, const MatrixXd& K, double limit)
{
  std::vector<TwoSidedPair> result;
  const Index n = K.rows();
  const double stiffness = n > 0 ? norm_1(K) : 0, mass = n > 0 ? norm_1(M) : 0;
  if (mass == 0 || stiffness == 0) return result;
  const bool all = !std::isfinite(limit);
  const double omega = all ? std::sqrt(stiffness / mass) : limit;
  const double shift = all ? 1e-2 : 0.2; // of nu = lambda/omega: any that is no eigenvalue
  const MatrixXd m = omega * omega / stiffness * M, c = omega / stiffness * C, k = K / stiffness;
  const auto [re, im, left, right] = dominant_eigenvectors(companion(m, c, k, shift), all ? 0 : 1 / (1 + shift));
  const MatrixXd chi =
      solve_dense((k + shift * (c + shift * m)).transpose(), left.topRows(n),
                  "the quadratic eigenproblem is singular: some motion has neither mass nor stiffness");
  for (Index j = 0; j < re.size(); ++j)
  {
    const Complex mu(re(j), im(j));
    if (mu.imag() < 0 || std::abs(mu) < 1e-12) continue; // a conjugate; or lambda is infinite, without mass
    // LAPACK's left vectors u obey u^H A = mu u^H. Im(1/mu) < 0 where Im(mu) > 0: the pair's conjugate is taken.
    const auto part = std::abs(mu) > 1 ? right.topRows(n) : right.bottomRows(n);
    TwoSidedPair pair{std::conj(omega * (shift + 1.0 / mu)), part.col(j).cast<Complex>(), chi.col(j).cast<Complex>()};
    if (mu.imag() != 0)
    {
      pair.right.imag() = -part.col(j + 1);
      pair.left.imag() = chi.col(j + 1);
    }
    pair.right.normalize();
    pair.left.normalize();
    result.push_back(std::move(pair));
  }
  return result;
}

/// Gives every rank the pairs of rank 0, whose vectors have the names `vectors` and `rows` entries.
template <class Pair> void share_pairs(MPI_Comm comm, std::vector<Pair>& pairs, Index rows,
                                       std::initializer_list<Eigen::VectorXcd Pair::*> vectors)
{
  int count = to_int(pairs.size());
  MPI_Bcast(&count, 1, MPI_INT, 0, comm);
  pairs.resize(static_cast<std::size_t>(count));
  for (Pair& pair : pairs)
  {
    MPI_Bcast(&pair.lambda, 1, MPI_CXX_DOUBLE_COMPLEX, 0, comm);
    for (const auto member : vectors)
    {
      (pair.*member).resize(rows);
      MPI_Bcast((pair.*member).data(), to_int(rows), MPI_CXX_DOUBLE_COMPLEX, 0, comm);
    }
  }
}

} // namespace

namespace
{

/// By the eigenvalues nu = 1/(theta + limit) of (K + limit M)^-1 M, whose left vectors u give (K + limit M)^-T u.
InvariantSubspaces invariant_subspaces(const MatrixXd& M, const MatrixXd& K, double limit)
{
  const char* singular = "the undamped eigenproblem is singular at its shift";
  const MatrixXd shifted = K + limit * M, A = solve_dense(shifted, M, singular);
  const auto [re, im, left, right] = dominant_eigenvectors(A, 1 / (2 * limit)); // |nu|, of all |theta| <= limit
  std::vector<Index> wanted; // real and imaginary parts of a pair have one |theta|
  for (Index j = 0; j < re.size(); ++j)
    if (const Complex nu(re(j), im(j)); nu != 0. && std::abs(1. / nu - limit) <= limit) wanted.push_back(j);
  const MatrixXd chosen = left(Eigen::all, wanted);
  return {orthonormal_columns(right(Eigen::all, wanted)),
          orthonormal_columns(solve_dense(shifted.transpose(), chosen, singular))};
}

} // namespace

InvariantSubspaces invariant_subspaces_shared(MPI_Comm comm, const MatrixXd& M, const MatrixXd& K, double limit)
{
  InvariantSubspaces spaces;
  on_rank_zero(comm, [&] { spaces = invariant_subspaces(M, K, limit); });
  broadcast(spaces.right, comm);
  broadcast(spaces.left, comm);
  return spaces;
}

Eigen::MatrixXcd vectors_of(std::span<const TwoSidedPair> pairs, Eigen::VectorXcd TwoSidedPair::*side)
{
  if (pairs.empty()) return {};
  Eigen::MatrixXcd vectors((pairs.front().*side).size(), static_cast<Index>(pairs.size()));
  for (Index column = 0; const TwoSidedPair& pair : pairs) vectors.col(column++) = pair.*side;
  return vectors;
}

void share(MPI_Comm comm, std::vector<TwoSidedPair>& pairs, Index rows)
{
  share_pairs(comm, pairs, rows, {&TwoSidedPair::right, &TwoSidedPair::left});
}

std::vector<TwoSidedPair> solve_two_sided_shared(MPI_Comm comm, const MatrixXd& M, const MatrixXd& C, const MatrixXd& K,
                                                 double limit)
{
  std::vector<TwoSidedPair> pairs;
  on_rank_zero(comm, [&] { pairs = solve_two_sided(M, C, K, limit); });
  share(comm, pairs, K.rows());
  return pairs;
}

std::vector<DenseEigenpair> solve_dense_quadratic(const MatrixXd& M, const MatrixXd& C, const MatrixXd& K)
{
  std::vector<DenseEigenpair> result;
  const Index n = K.rows();
  if (n == 0) return result;
  const double stiffness = norm_1(K), mass = norm_1(M);
  if (mass == 0 || stiffness == 0) return result;
  const double omega = std::sqrt(stiffness / mass), shift = 1e-2; // of nu = lambda/omega: any that is no eigenvalue
  const Eigen::EigenSolver<MatrixXd> solver(
      companion(omega * omega / stiffness * M, omega / stiffness * C, K / stiffness, shift));
  if (solver.info() != Eigen::Success)
    throw Error("the QR algorithm did not converge on the dense quadratic eigenproblem");
  // The columns of a pair with Im(mu) > 0 are the real and the imaginary part of its vector.
  const MatrixXd& vectors = solver.pseudoEigenvectors();
  for (Index k = 0; k < 2 * n; ++k)
  {
    const Complex mu = solver.eigenvalues()(k);
    if (mu.imag() < 0 || std::abs(mu) < 1e-12) continue; // a conjugate; or lambda is infinite, without mass
    // Of mu y and y the one of larger entries is taken. Im(1/mu) < 0 where Im(mu) > 0: the pair's conjugate is taken.
    const auto part = std::abs(mu) > 1 ? vectors.topRows(n) : vectors.bottomRows(n);
    DenseEigenpair pair{std::conj(omega * (shift + 1.0 / mu)), part.col(k).cast<Complex>()};
    if (mu.imag() != 0) pair.y.imag() = -part.col(k + 1);
    pair.y.normalize();
    result.push_back(std::move(pair));
  }
  return result;
}

std::vector<DenseEigenpair> solve_dense_quadratic_shared(MPI_Comm comm, const MatrixXd& M, const MatrixXd& C,
                                                         const MatrixXd& K)
{
  std::vector<DenseEigenpair> pairs;
  on_rank_zero(comm, [&] { pairs = solve_dense_quadratic(M, C, K); });
  share_pairs(comm, pairs, K.rows(), {&DenseEigenpair::y});
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

std::vector<Complex> dense_quadratic_eigenvalues(const MatrixXd& M, const MatrixXd& C, const MatrixXd& K)
{
  std::vector<Complex> result;
  const double stiffness = K.rows() > 0 ? norm_1(K) : 0, mass = K.rows() > 0 ? norm_1(M) : 0;
  if (mass == 0 || stiffness == 0) return result;
  const double omega = std::sqrt(stiffness / mass), shift = 1e-2; // of nu = lambda/omega: any that is no eigenvalue
  MatrixXd A = companion(omega * omega / stiffness * M, omega / stiffness * C, K / stiffness, shift);
  VectorXd re(A.rows()), im(A.rows());
  const int size = to_int(A.rows());
  if (LAPACKE_dgeev(LAPACK_COL_MAJOR, 'N', 'N', size, A.data(), size, re.data(), im.data(), nullptr, size, nullptr,
                    size) != 0)
    throw Error("the QR algorithm did not converge on the dense quadratic eigenproblem");
  for (Index j = 0; j < A.rows(); ++j)
    if (const Complex mu(re(j), im(j)); mu.imag() >= 0 && std::abs(mu) >= 1e-12)
      result.push_back(std::conj(omega * (shift + 1.0 / mu)));
  return result;
}

namespace
{

/// Three steps of inverse iteration from the pair's vectors.
void iterate(const MatrixXd& M, const MatrixXd& C, const MatrixXd& K, TwoSidedPair& pair)
{
  const Complex near = pair.lambda * (1 + 1e-10); // so that no pivot vanishes
  const Eigen::MatrixXcd Q = near * near * M.cast<Complex>() + near * C.cast<Complex>() + K.cast<Complex>();
  const Eigen::PartialPivLU<Eigen::MatrixXcd> factor(Q);
  for (int iteration = 0; iteration < 3; ++iteration)
  {
    pair.right = factor.solve(pair.right).normalized();
    pair.left = factor.transpose().solve(pair.left).normalized();
  }
}

/// The root of left'(lambda^2 M + lambda C + K) right that is nearest to the pair's lambda.
Complex rayleigh_quotient(const MatrixXd& M, const MatrixXd& C, const MatrixXd& K, const TwoSidedPair& pair)
{
  const auto form = [&](const MatrixXd& A) -> Complex { return pair.left.transpose() * (A * pair.right); };
  const Complex m = form(M), c = form(C), k = form(K), root = std::sqrt(c * c - 4. * m * k);
  const Complex one = (root - c) / (2. * m), other = (-root - c) / (2. * m);
  return std::abs(one - pair.lambda) < std::abs(other - pair.lambda) ? one : other;
}

} // namespace

TwoSidedPair two_sided_pair(const MatrixXd& M, const MatrixXd& C, const MatrixXd& K, Complex lambda)
{
  TwoSidedPair pair{lambda, Eigen::VectorXcd::Ones(K.rows()), Eigen::VectorXcd::Ones(K.rows())};
  iterate(M, C, K, pair);
  return pair;
}

void refine_pairs_shared(MPI_Comm comm, const MatrixXd& M, const MatrixXd& C, const MatrixXd& K,
                         std::vector<TwoSidedPair>& pairs)
{
  const auto refine = [&]
  {
    for (TwoSidedPair& pair : pairs)
    {
      iterate(M, C, K, pair);
      pair.lambda = rayleigh_quotient(M, C, K, pair);
    }
  };
  on_rank_zero(comm, refine);
  share(comm, pairs, K.rows());
}

std::vector<DenseEigenpair> solve_dense_unsymmetric(const MatrixXd& A)
{
  const Eigen::EigenSolver<MatrixXd> solver(A);
  if (solver.info() != Eigen::Success) throw Error("the eigenvalues of a dense matrix did not converge");
  std::vector<DenseEigenpair> pairs;
  const Eigen::MatrixXcd vectors = solver.eigenvectors();
  for (Eigen::Index i = 0; i < A.rows(); ++i)
    if (solver.eigenvalues()(i).imag() >= 0) pairs.push_back({solver.eigenvalues()(i), vectors.col(i).normalized()});
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const DenseEigenpair& a, const DenseEigenpair& b)
                   { return std::abs(a.lambda) > std::abs(b.lambda); });
  std::vector<DenseEigenpair> all;
  for (DenseEigenpair& pair : pairs)
  {
    const bool real = pair.lambda.imag() == 0;
    DenseEigenpair conjugate{std::conj(pair.lambda), pair.y.conjugate()};
    all.push_back(std::move(pair));
    if (!real) all.push_back(std::move(conjugate));
  }
  return all;
}

Eigen::MatrixXd real_columns(const std::vector<DenseEigenpair>& pairs, Eigen::Index size)
{
  Eigen::MatrixXd result(size, static_cast<Eigen::Index>(pairs.size()));
  for (Eigen::Index i = 0; i < result.cols(); ++i)
  {
    const DenseEigenpair& pair = pairs[static_cast<std::size_t>(i)];
    result.col(i) = pair.lambda.imag() < 0 ? Eigen::VectorXd(-pair.y.imag()) : Eigen::VectorXd(pair.y.real());
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
  const auto distance = [&](std::size_t reference, std::size_t place) // those beyond the references are for nobody
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
