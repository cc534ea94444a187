#include "squeal/algebra/dense_eigenproblems.hpp"

#include <algorithm>
#include <cmath>
#include <petscblaslapack.h>

namespace squeal
{

namespace
{

using Index = std::size_t;

double norm_of(int n, const std::vector<double>& A)
{
  double largest = 0;
  for (int j = 0; j < n; ++j)
  {
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += std::abs(A[static_cast<Index>(i + j * n)]);
    largest = std::max(largest, sum);
  }
  return largest;
}

// With nu = shift + 1/mu and Q = Q(shift):  Q mu^2 + (C + 2 shift M) mu + M = 0, whose companion matrix is
// [-Q^-1 (C + 2 shift M), -Q^-1 M; I, 0] on (mu y, y).
std::vector<double> companion(int n, const std::vector<double>& M, const std::vector<double>& C,
                              const std::vector<double>& K, double shift)
{
  const Index size = static_cast<Index>(n) * static_cast<Index>(n);
  std::vector<double> Q(size), right(2 * size);
  for (Index i = 0; i < size; ++i)
  {
    Q[i] = K[i] + shift * (C[i] + shift * M[i]);
    right[i] = -C[i] - 2 * shift * M[i];
    right[size + i] = -M[i];
  }
  const PetscBLASInt order = n, columns = 2 * n;
  PetscBLASInt info = 0;
  std::vector<PetscBLASInt> pivots(static_cast<Index>(n));
  LAPACKgesv_(&order, &columns, Q.data(), &order, pivots.data(), right.data(), &order, &info);
  if (info != 0) throw Error("the quadratic eigenproblem is singular: some motion has neither mass nor stiffness");
  std::vector<double> A(4 * size, 0.0);
  for (int j = 0; j < 2 * n; ++j)
    std::copy_n(right.begin() + static_cast<std::ptrdiff_t>(j) * n, n,
                A.begin() + static_cast<std::ptrdiff_t>(j) * 2 * n);
  for (int j = 0; j < n; ++j) A[static_cast<Index>(n + j + j * 2 * n)] = 1;
  return A;
}

struct Spectrum
{
  std::vector<double> real, imaginary, vectors;
};

Spectrum eigenvalues_of(int size, std::vector<double> A)
{
  const PetscBLASInt order = size, one = 1;
  const auto count = static_cast<Index>(size);
  Spectrum result{std::vector<double>(count), std::vector<double>(count), std::vector<double>(count * count)};
  PetscBLASInt info = 0, work_size = -1;
  double wanted = 0, unused = 0;
  LAPACKgeev_("N", "V", &order, A.data(), &order, result.real.data(), result.imaginary.data(), &unused, &one,
              result.vectors.data(), &order, &wanted, &work_size, &info);
  work_size = static_cast<PetscBLASInt>(wanted);
  std::vector<double> work(static_cast<Index>(work_size));
  LAPACKgeev_("N", "V", &order, A.data(), &order, result.real.data(), result.imaginary.data(), &unused, &one,
              result.vectors.data(), &order, work.data(), &work_size, &info);
  if (info != 0) throw Error("LAPACK's QR algorithm (geev) failed on the dense quadratic eigenproblem");
  return result;
}

} // namespace

std::vector<DenseEigenpair> solve_dense_quadratic(int n, const std::vector<double>& M, const std::vector<double>& C,
                                                  const std::vector<double>& K)
{
  std::vector<DenseEigenpair> result;
  if (n == 0) return result;
  const double stiffness = norm_of(n, K), mass = norm_of(n, M);
  if (mass == 0 || stiffness == 0) return result;
  const double omega = std::sqrt(stiffness / mass), shift = 1e-2; // of nu = lambda / omega; any non-eigenvalue serves
  std::vector<double> scaled_M = M, scaled_C = C, scaled_K = K;
  for (double& entry : scaled_M) entry *= omega * omega / stiffness;
  for (double& entry : scaled_C) entry *= omega / stiffness;
  for (double& entry : scaled_K) entry /= stiffness;
  const int size = 2 * n;
  const Spectrum spectrum = eigenvalues_of(size, companion(n, scaled_M, scaled_C, scaled_K, shift));
  for (int k = 0; k < size; ++k)
  {
    const std::complex<double> mu(spectrum.real[static_cast<Index>(k)], spectrum.imaginary[static_cast<Index>(k)]);
    const bool pair = mu.imag() != 0;
    if (mu.imag() < 0 || std::abs(mu) < 1e-12) continue; // the conjugate was taken; lambda is infinite without mass
    // Im(1/mu) < 0 where Im(mu) > 0: take the conjugate of both. The better scaled of mu y and y is y.
    const Index part = std::abs(mu) > 1 ? 0 : static_cast<Index>(n);
    DenseEigenpair found{std::conj(omega * (shift + 1.0 / mu)),
                         std::vector<std::complex<double>>(static_cast<Index>(n))};
    const double* first = spectrum.vectors.data() + static_cast<Index>(k) * static_cast<Index>(size) + part;
    for (int i = 0; i < n; ++i) found.y[static_cast<Index>(i)] = {first[i], pair ? -first[i + size] : 0.0};
    result.push_back(std::move(found));
  }
  return result;
}

std::vector<DenseEigenpair> solve_dense_quadratic_shared(MPI_Comm comm, int n, const std::vector<double>& M,
                                                         const std::vector<double>& C, const std::vector<double>& K)
{
  std::vector<DenseEigenpair> pairs;
  on_rank_zero(comm, [&] { pairs = solve_dense_quadratic(n, M, C, K); });
  int count = static_cast<int>(pairs.size());
  MPI_Bcast(&count, 1, MPI_INT, 0, comm);
  pairs.resize(static_cast<Index>(count));
  for (DenseEigenpair& pair : pairs)
  {
    pair.y.resize(static_cast<Index>(n));
    MPI_Bcast(&pair.lambda, 1, MPI_CXX_DOUBLE_COMPLEX, 0, comm);
    MPI_Bcast(pair.y.data(), n, MPI_CXX_DOUBLE_COMPLEX, 0, comm);
  }
  return pairs;
}

void solve_dense_symmetric(int n, const std::vector<double>& M, const std::vector<double>& K, double shift,
                           std::vector<double>& lambda, std::vector<double>& y)
{
  // M y = theta (K - shift M) y, theta = 1/(lambda - shift): bears a singular M.
  lambda.clear();
  y.clear();
  if (n == 0) return;
  std::vector<double> A = M, B = K, theta(static_cast<Index>(n));
  for (Index i = 0; i < B.size(); ++i) B[i] -= shift * M[i];
  const PetscBLASInt order = n, kind = 1;
  PetscBLASInt info = 0, work_size = -1;
  double wanted = 0;
  LAPACKsygv_(&kind, "V", "U", &order, A.data(), &order, B.data(), &order, theta.data(), &wanted, &work_size, &info);
  work_size = static_cast<PetscBLASInt>(wanted);
  std::vector<double> work(static_cast<Index>(work_size));
  LAPACKsygv_(&kind, "V", "U", &order, A.data(), &order, B.data(), &order, theta.data(), work.data(), &work_size,
              &info);
  if (info != 0)
    throw Error("the real modes fail: stiffness is not positive semidefinite, or some motion has neither "
                "mass nor stiffness");
  for (int k = n - 1; k >= 0; --k)
  {
    const double value = theta[static_cast<Index>(k)];
    if (value <= 1e-14 * theta.back()) break;
    lambda.push_back(shift + 1 / value);
    const double* shape = A.data() + static_cast<Index>(k) * static_cast<Index>(n);
    for (int i = 0; i < n; ++i) y.push_back(shape[i] / std::sqrt(value));
  }
}

std::vector<double> dense_copy(Mat A)
{
  PetscInt rows = 0, columns = 0;
  check(MatGetSize(A, &rows, &columns));
  Owned<IS> all_rows, all_columns;
  check(ISCreateStride(PETSC_COMM_SELF, rows, 0, 1, all_rows.put()));
  check(ISCreateStride(PETSC_COMM_SELF, columns, 0, 1, all_columns.put()));
  const IS row_set = all_rows, column_set = all_columns;
  Mat* parts = nullptr;
  check(MatCreateSubMatrices(A, 1, &row_set, &column_set, MAT_INITIAL_MATRIX, &parts));
  std::vector<double> result(static_cast<Index>(rows) * static_cast<Index>(columns), 0.0);
  for_each_row(parts[0],
               [&](PetscInt i, std::span<const PetscInt> column, std::span<const PetscScalar> value)
               {
                 for (Index k = 0; k < column.size(); ++k)
                   result[static_cast<Index>(i) + static_cast<Index>(column[k]) * static_cast<Index>(rows)] = value[k];
               });
  check(MatDestroySubMatrices(1, &parts));
  return result;
}

void quadratic_residual(Mat M, Mat C, Mat K, std::complex<double> lambda, Vec y_r, Vec y_i, Vec real, Vec imaginary)
{
  const std::complex<double> square = lambda * lambda;
  const Owned<Vec> a = zeros_like(real), b = zeros_like(real);
  check(MatMult(K, y_r, real));
  check(MatMult(K, y_i, imaginary));
  for (const auto& [A, factor] : {std::pair{C, lambda}, std::pair{M, square}})
  {
    check(MatMult(A, y_r, a));
    check(MatMult(A, y_i, b));
    check(VecAXPBYPCZ(real, factor.real(), -factor.imag(), 1, a, b));
    check(VecAXPBYPCZ(imaginary, factor.imag(), factor.real(), 1, a, b));
  }
}

} // namespace squeal
