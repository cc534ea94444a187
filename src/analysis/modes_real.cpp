#include "squeal/analysis/real_modes.hpp"

#include "squeal/analysis/closed_contact.hpp"
#include "squeal/analysis/quadratic.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

MPI_Comm comm_of(Mat A)
{
  return PetscObjectComm(reinterpret_cast<PetscObject>(A));
}

double trace(Mat A)
{
  double result = 0;
  check(MatGetTrace(A, &result));
  return result;
}

// Sylvester: as many eigenvalues lie below lambda as K - lambda M has negative pivots.
int inertia_below(Mat M, Mat K, double lambda)
{
  const Owned<Mat> A = shifted(M, K, lambda);
  Owned<Mat> factor;
  MatFactorInfo settings;
  check(MatFactorInfoInitialize(&settings));
  check(MatGetFactor(A, MATSOLVERMUMPS, MAT_FACTOR_CHOLESKY, factor.put()));
  check(MatCholeskyFactorSymbolic(factor, A, nullptr, &settings));
  check(MatCholeskyFactorNumeric(factor, A, &settings));
  PetscInt negative = 0;
  check(MatMumpsGetInfog(factor, 12, &negative)); // MatGetInertia insists on null pivot detection, which is not wanted
  return static_cast<int>(negative);
}

struct DenseModes
{
  std::vector<double> lambda, y;
};

DenseModes solve_whole(Mat M, Mat K)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  const double shift = shift_below_zero(M, K);
  const std::vector<double> dense_M = dense_copy(M), dense_K = dense_copy(K);
  DenseModes modes;
  on_rank_zero(comm_of(K),
               [&] { solve_dense_symmetric(static_cast<int>(n), dense_M, dense_K, shift, modes.lambda, modes.y); });
  int count = static_cast<int>(modes.lambda.size());
  MPI_Bcast(&count, 1, MPI_INT, 0, comm_of(K));
  modes.lambda.resize(static_cast<std::size_t>(count));
  modes.y.resize(static_cast<std::size_t>(count) * static_cast<std::size_t>(n));
  MPI_Bcast(modes.lambda.data(), count, MPI_DOUBLE, 0, comm_of(K));
  MPI_Bcast(modes.y.data(), static_cast<int>(modes.y.size()), MPI_DOUBLE, 0, comm_of(K));
  return modes;
}

RealModes first_of(const DenseModes& all, Mat K, int count)
{
  PetscInt n = 0, first = 0, last = 0;
  check(MatGetSize(K, &n, nullptr));
  check(MatGetOwnershipRange(K, &first, &last));
  RealModes modes;
  const int given = std::min(count, static_cast<int>(all.lambda.size()));
  modes.outcome = {"converged", "", 1, 0};
  for (int k = 0; k < given; ++k)
  {
    Owned<Vec> shape;
    check(MatCreateVecs(K, shape.put(), nullptr));
    for (PetscInt i = first; i < last; ++i)
      check(VecSetValue(shape, i, all.y[static_cast<std::size_t>(k * n + i)], INSERT_VALUES));
    check(VecAssemblyBegin(shape));
    check(VecAssemblyEnd(shape));
    modes.omega.push_back(std::sqrt(std::max(0.0, all.lambda[static_cast<std::size_t>(k)])));
    modes.shapes.push_back(std::move(shape));
  }
  return modes;
}

Owned<EPS> make_solver(Mat M, Mat K, int count, double shift)
{
  Owned<EPS> eps;
  check(EPSCreate(comm_of(K), eps.put()));
  check(EPSSetOperators(eps, K, M));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetType(eps, EPSKRYLOVSCHUR));
  check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  check(EPSSetTarget(eps, shift));
  check(EPSSetDimensions(eps, count, PETSC_DEFAULT, PETSC_DEFAULT));
  check(EPSSetTolerances(eps, 1e-10, 500));
  ST transformation = nullptr;
  KSP solver = nullptr;
  PC factor = nullptr;
  check(EPSGetST(eps, &transformation));
  check(STSetType(transformation, STSINVERT));
  check(STGetKSP(transformation, &solver));
  check(KSPSetType(solver, KSPPREONLY));
  check(KSPGetPC(solver, &factor));
  check(PCSetType(factor, PCCHOLESKY));
  check(PCFactorSetMatSolverType(factor, MATSOLVERMUMPS));
  check(EPSSetOptionsPrefix(eps, "modes_"));
  check(EPSSetFromOptions(eps));
  return eps;
}

RealModes solve_sparse(Mat M, Mat K, int count)
{
  const Owned<EPS> eps = make_solver(M, K, count, shift_below_zero(M, K));
  check(EPSSolve(eps));
  PetscInt converged = 0, iterations = 0;
  check(EPSGetConverged(eps, &converged));
  check(EPSGetIterationNumber(eps, &iterations));
  RealModes modes;
  modes.outcome = {"converged", "", static_cast<int>(iterations), 0};
  double stiffness = 0;
  check(MatNorm(K, NORM_1, &stiffness));
  for (PetscInt k = 0; k < std::min<PetscInt>(converged, count); ++k)
  {
    Owned<Vec> shape, residual;
    check(MatCreateVecs(K, shape.put(), residual.put()));
    double lambda = 0, size = 0, left = 0;
    check(EPSGetEigenpair(eps, k, &lambda, nullptr, shape, nullptr));
    const Owned<Vec> inertia = zeros_like(residual);
    check(MatMult(K, shape, residual));
    check(MatMult(M, shape, inertia));
    check(VecAXPY(residual, -lambda, inertia));
    check(VecNorm(residual, NORM_2, &left));
    check(VecNorm(shape, NORM_2, &size));
    modes.outcome.residual = std::max(modes.outcome.residual, left / (stiffness * size));
    modes.omega.push_back(std::sqrt(std::max(0.0, lambda)));
    modes.shapes.push_back(std::move(shape));
  }
  return modes;
}

// A multiple frequency may be cut at the end, so the count is taken just below the last one.
bool is_complete(Mat M, Mat K, const RealModes& modes)
{
  const double last = modes.omega.back(), limit = last * last * (1 - 1e-6);
  const auto below = std::count_if(modes.omega.begin(), modes.omega.end(), [&](double w) { return w * w < limit; });
  return below == inertia_below(M, K, limit);
}

struct BilateralProblem
{
  ClosedContact contact;
  Owned<Mat> M, K;
};

BilateralProblem make_bilateral(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium)
{
  BilateralProblem result;
  result.contact = eliminate_closed_pairs(structure, interface, equilibrium);
  result.M = project_symmetric(structure.M, result.contact.Z);
  result.K = project_symmetric(structure.K, result.contact.Z);
  return result;
}

void to_structure(RealModes& modes, const BilateralProblem& problem)
{
  for (Owned<Vec>& shape : modes.shapes)
  {
    Owned<Vec> whole;
    check(MatCreateVecs(problem.contact.Z, nullptr, whole.put()));
    check(MatMult(problem.contact.Z, shape, whole));
    shape = std::move(whole);
  }
}

} // namespace

double shift_below_zero(Mat M, Mat K)
{
  return -1e-8 * trace(K) / trace(M);
}

Owned<Mat> shifted(Mat M, Mat K, double shift)
{
  Owned<Mat> A;
  check(MatDuplicate(K, MAT_COPY_VALUES, A.put()));
  check(MatAXPY(A, -shift, M, UNKNOWN_NONZERO_PATTERN));
  check(MatSetOption(A, MAT_SYMMETRIC, PETSC_TRUE));
  return A;
}

int count_real_modes(Mat M, Mat K, double band, int dense_limit)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  const double omega = 2 * std::numbers::pi * band;
  if (n > dense_limit) return inertia_below(M, K, omega * omega);
  const std::vector<double> lambda = solve_whole(M, K).lambda;
  return static_cast<int>(
      std::count_if(lambda.begin(), lambda.end(), [&](double value) { return value < omega * omega; }));
}

RealModes solve_real_modes(Mat M, Mat K, int count, int dense_limit)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  if (count <= 0) return {{"converged", "", 0, 0}, {}, {}};
  if (n <= dense_limit) return first_of(solve_whole(M, K), K, count);
  count = std::min(count, static_cast<int>(n));
  RealModes modes;
  for (int asked = count; asked <= std::min(static_cast<int>(n), 2 * count + 20); asked += asked / 4 + 4)
  {
    modes = solve_sparse(M, K, asked);
    if (modes.omega.empty() || !is_complete(M, K, modes)) continue;
    if (static_cast<int>(modes.omega.size()) < count) break;
    modes.omega.resize(static_cast<std::size_t>(count));
    modes.shapes.resize(static_cast<std::size_t>(count));
    return modes;
  }
  modes.outcome.word = "not converged";
  modes.outcome.reason = std::to_string(modes.omega.size()) + " real modes found of " + std::to_string(count);
  return modes;
}

int dense_limit_option()
{
  PetscInt limit = 200;
  check(PetscOptionsGetInt(nullptr, "modes_", "-dense_limit", &limit, nullptr));
  return static_cast<int>(limit);
}

RealModes find_real_modes(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                          int count)
{
  const BilateralProblem problem = make_bilateral(structure, interface, equilibrium);
  RealModes modes = solve_real_modes(problem.M, problem.K, count, dense_limit_option());
  to_structure(modes, problem);
  return modes;
}

RealModes find_real_modes_below(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                                double band)
{
  const BilateralProblem problem = make_bilateral(structure, interface, equilibrium);
  const int limit = dense_limit_option(), count = count_real_modes(problem.M, problem.K, band, limit);
  PetscInt n = 0;
  check(MatGetSize(problem.K, &n, nullptr));
  // A preconditioner can miss one mode of a cluster; looking for it again would cost more than all the others.
  RealModes modes = n > limit && count > 0 ? solve_sparse(problem.M, problem.K, std::min(count, static_cast<int>(n)))
                                           : solve_real_modes(problem.M, problem.K, count, limit);
  to_structure(modes, problem);
  return modes;
}

} // namespace squeal
