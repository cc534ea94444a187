#include "squeal/analysis/complex_shift.hpp"

#include "squeal/analysis/projection.hpp"

#include <algorithm>
#include <cmath>
#include <petscblaslapack.h>

extern "C" void zgeev_(const char* left, const char* right, const PetscBLASInt* n, std::complex<double>* A,
                       const PetscBLASInt* lda, std::complex<double>* w, std::complex<double>* vl,
                       const PetscBLASInt* ldvl, std::complex<double>* vr, const PetscBLASInt* ldvr,
                       std::complex<double>* work, const PetscBLASInt* lwork, double* rwork, PetscBLASInt* info);

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index, Eigen::MatrixXcd, Eigen::VectorXcd;

constexpr PetscInt block_size = 6;      // solved for at once
constexpr PetscInt largest_space = 800; // vectors
constexpr double tolerance = 1e-11;     // of a pair, relative to its eigenvalue of the inverse

// |s| (A - s B)^-1 B Z, on z = (y, lambda y / |s|).
ComplexBlock multiplied(const QuadraticProblem& problem, const ComplexFactor& factor, const ComplexBlock& Z)
{
  const Complex s = factor.s();
  const double omega = std::abs(s);
  const ComplexBlock first = upper_half(Z);
  ComplexBlock second = lower_half(Z); // B z, less what the first row eliminates: -(|s| M z_2 + (C + s M) z_1)
  ComplexBlock right = product(problem.C, first);
  ComplexBlock inertia = second;
  for (Block* part : {&inertia.re, &inertia.im})
    for (double& entry : part->entries) entry *= omega;
  add(inertia, s, first);
  add(right, 1, product(problem.M, inertia));
  for (Block* part : {&right.re, &right.im})
    for (double& entry : part->entries) entry *= -omega;
  const ComplexBlock upper = factor.solved(right);
  second = first;
  add(second, s / omega, upper);
  return stacked(upper, second);
}

// (A - s B)^-1 B V_k = V H: the columns of H are those of V multiplied so far, its rows all of V.
struct Arnoldi
{
  ComplexBlock V;
  MatrixXcd H;

  PetscInt order() const { return static_cast<PetscInt>(H.cols()); }
};

void grow(Arnoldi& arnoldi, const QuadraticProblem& problem, const ComplexFactor& factor)
{
  const Index before = arnoldi.order();
  ComplexBlock S = multiplied(problem, factor, columns_from(arnoldi.V, arnoldi.order()));
  const MatrixXcd fresh = extend_orthonormal(arnoldi.V, std::move(S));
  MatrixXcd H = MatrixXcd::Zero(fresh.rows(), before + fresh.cols());
  H.topLeftCorner(arnoldi.H.rows(), before) = arnoldi.H;
  H.rightCols(fresh.cols()) = fresh;
  arnoldi.H = std::move(H);
}

// Eigenpairs of the square part of H: |nu| at least `least`, and the `count` largest.
struct Ritz
{
  VectorXcd nu;
  MatrixXcd vectors;
  double residual = 0; // the largest, over |nu|
};

Ritz ritz_pairs(const Arnoldi& arnoldi, double least, int count)
{
  const PetscBLASInt n = static_cast<PetscBLASInt>(arnoldi.order()), one = 1, work_size = 40 * n;
  MatrixXcd A = arnoldi.H.topRows(n), vectors(n, n);
  VectorXcd nu(n), work(work_size), growth(2 * n);
  PetscBLASInt info = 0;
  zgeev_("N", "V", &n, A.data(), &n, nu.data(), nullptr, &one, vectors.data(), &n, work.data(), &work_size,
         reinterpret_cast<double*>(growth.data()), &info);
  if (info != 0) throw Error("LAPACK's QR algorithm (zgeev) failed on the modes' Arnoldi matrix");
  std::vector<double> descending;
  for (const Complex value : nu) descending.push_back(std::abs(value));
  std::sort(descending.rbegin(), descending.rend());
  if (count > 0 && count <= n) least = std::min(least, (1 - 1e-12) * descending[static_cast<std::size_t>(count - 1)]);
  Ritz result{VectorXcd(n), MatrixXcd(n, n), 0};
  Index wanted = 0;
  for (Index k = 0; k < n; ++k)
  {
    if (std::abs(nu[k]) < least) continue;
    result.nu[wanted] = nu[k];
    result.vectors.col(wanted) = vectors.col(k);
    const double miss = (arnoldi.H.bottomRows(arnoldi.H.rows() - n) * vectors.col(k)).norm();
    result.residual = std::max(result.residual, miss / std::abs(nu[k]));
    ++wanted;
  }
  result.nu.conservativeResize(wanted);
  result.vectors.conservativeResize(n, wanted);
  return result;
}

// On rank 0, told to all: what follows must be the same everywhere.
Ritz ritz_pairs_shared(const Arnoldi& arnoldi, double least, int count)
{
  Ritz ritz;
  const MPI_Comm comm = arnoldi.V.re.comm;
  on_rank_zero(comm, [&] { ritz = ritz_pairs(arnoldi, least, count); });
  int found = static_cast<int>(ritz.nu.size());
  MPI_Bcast(&found, 1, MPI_INT, 0, comm);
  MPI_Bcast(&ritz.residual, 1, MPI_DOUBLE, 0, comm);
  ritz.nu.conservativeResize(found);
  ritz.vectors.conservativeResize(arnoldi.order(), found);
  MPI_Bcast(ritz.nu.data(), found, MPI_CXX_DOUBLE_COMPLEX, 0, comm);
  MPI_Bcast(ritz.vectors.data(), static_cast<int>(ritz.vectors.size()), MPI_CXX_DOUBLE_COMPLEX, 0, comm);
  return ritz;
}

Arnoldi start(const QuadraticProblem& problem)
{
  PetscInt n = 0;
  check(MatGetSize(problem.K, &n, nullptr));
  const PetscInt columns = std::min(n, block_size);
  const Block y = uneven_block(problem.K, columns);
  const Block nothing{y.comm, y.rows, columns, std::vector<double>(y.entries.size(), 0.)};
  const Block none{y.comm, 2 * y.rows, 0, {}};
  Arnoldi arnoldi{{none, none}, {}};
  extend_orthonormal(arnoldi.V, stacked({y, nothing}, {nothing, nothing}));
  return arnoldi;
}

} // namespace

NearestPairs solve_nearest_pairs(const QuadraticProblem& problem, const ComplexFactor& factor, double radius, int count)
{
  const double omega = std::abs(factor.s());
  Arnoldi arnoldi = start(problem);
  NearestPairs result;
  const PetscInt room = std::max<PetscInt>(largest_space, 4 * count), check_from = 3 * count + 4 * block_size;
  for (int round = 0; !result.converged && arnoldi.V.columns() < room; ++round)
  {
    grow(arnoldi, problem, factor);
    const bool exhausted = arnoldi.V.columns() == arnoldi.order();
    if (!exhausted && (arnoldi.order() < check_from || round % 3 != 0)) continue;
    const Ritz ritz = ritz_pairs_shared(arnoldi, radius > 0 ? omega / radius : INFINITY, count);
    result.converged = exhausted || ritz.residual < tolerance;
    if (!result.converged) continue;
    for (const Complex nu : ritz.nu) result.lambda.push_back(factor.s() + omega / nu);
    ComplexBlock space = upper_half(arnoldi.V);
    MatrixXcd a = MatrixXcd::Zero(arnoldi.V.columns(), ritz.nu.size());
    a.topRows(arnoldi.order()) = ritz.vectors;
    result.y = combination(space, a);
  }
  return result;
}

Eigenpair solve_near(const QuadraticProblem& problem, Complex lambda)
{
  ComplexFactor factor(problem);
  factor.move_to(lambda * (1 + 1e-6)); // not on it, where there is no factor
  const NearestPairs nearest = solve_nearest_pairs(problem, factor, 0, 1);
  std::vector<Eigenpair> pairs = eigenpairs(problem, nearest.lambda, nearest.y);
  if (pairs.empty()) return {lambda, {}, {}, INFINITY};
  return std::move(pairs.front());
}

} // namespace squeal
