#include "squeal/analysis/projection.hpp"

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

struct Basis
{
  Owned<BV> V; // M-orthonormal columns; room for more than `size`
  PetscInt size = 0;
};

// Appends what is new in y; M-norms below 1e-8 of the vector's own are nothing new.
void append(Basis& basis, Vec y, Mat M)
{
  const Owned<Vec> My = zeros_like(y);
  double square = 0;
  check(MatMult(M, y, My));
  check(VecDot(y, My, &square));
  if (!(square > 0)) return;
  check(VecScale(y, 1 / std::sqrt(square)));
  check(BVInsertVec(basis.V, basis.size, y));
  double norm = 0;
  PetscBool dependent = PETSC_FALSE;
  check(BVOrthogonalizeColumn(basis.V, basis.size, nullptr, &norm, &dependent));
  if (dependent || norm < 1e-8) return;
  check(BVScaleColumn(basis.V, basis.size, 1 / norm));
  ++basis.size;
}

Basis make_basis(Mat M, const RealModes& modes, PetscInt room)
{
  Basis basis;
  Owned<Vec> pattern;
  PetscInt n = 0;
  check(MatGetSize(M, &n, nullptr));
  check(MatCreateVecs(M, pattern.put(), nullptr));
  check(BVCreate(comm_of(M), basis.V.put()));
  check(BVSetSizesFromVec(basis.V, pattern, std::min(n, static_cast<PetscInt>(modes.shapes.size()) + room) + 1));
  check(BVSetOptionsPrefix(basis.V, "modes_"));
  check(BVSetFromOptions(basis.V));
  check(BVSetMatrix(basis.V, M, PETSC_FALSE));
  for (const Owned<Vec>& shape : modes.shapes) append(basis, copy_of(shape), M);
  return basis;
}

// V'A V, column-major, on every rank
std::vector<double> on_basis(const Basis& basis, Mat A)
{
  Owned<Mat> small;
  check(MatCreateSeqDense(PETSC_COMM_SELF, basis.size, basis.size, nullptr, small.put()));
  check(BVSetActiveColumns(basis.V, 0, basis.size));
  check(BVMatProject(basis.V, A, basis.V, small));
  const PetscScalar* entries = nullptr;
  check(MatDenseGetArrayRead(small, &entries));
  std::vector<double> result(entries, entries + basis.size * basis.size);
  check(MatDenseRestoreArrayRead(small, &entries));
  return result;
}

Owned<Vec> expand(const Basis& basis, std::vector<double> coefficients, Mat pattern)
{
  Owned<Vec> y;
  check(MatCreateVecs(pattern, y.put(), nullptr));
  check(BVSetActiveColumns(basis.V, 0, basis.size));
  check(BVMultVec(basis.V, 1, 0, y, coefficients.data()));
  return y;
}

// The pairs of the small problem in the band, largest growth ratio first.
std::vector<DenseEigenpair> solve_on(const Basis& basis, const QuadraticProblem& problem, double band)
{
  std::vector<DenseEigenpair> found =
      solve_dense_quadratic_shared(comm_of(problem.K), static_cast<int>(basis.size), on_basis(basis, problem.M),
                                   on_basis(basis, problem.C), on_basis(basis, problem.K));
  std::erase_if(found,
                [&](const DenseEigenpair& pair)
                {
                  const bool vibrates = pair.lambda.imag() > 0 || pair.lambda.real() > 0;
                  return !vibrates || std::abs(pair.lambda) > 2 * std::numbers::pi * band;
                });
  std::sort(found.begin(), found.end(),
            [](const DenseEigenpair& a, const DenseEigenpair& b)
            { return a.lambda.real() * std::abs(b.lambda) > b.lambda.real() * std::abs(a.lambda); });
  return found;
}

Eigenpair in_problem(const Basis& basis, const QuadraticProblem& problem, const QuadraticNorms& norms,
                     const DenseEigenpair& found)
{
  std::vector<double> re, im;
  double size = 0;
  for (const std::complex<double>& a : found.y)
  {
    re.push_back(a.real());
    im.push_back(a.imag());
  }
  Eigenpair pair{found.lambda, expand(basis, re, problem.K), expand(basis, im, problem.K), 0};
  double squares[2];
  check(VecNorm(pair.real, NORM_2, &squares[0]));
  check(VecNorm(pair.imaginary, NORM_2, &squares[1]));
  size = std::hypot(squares[0], squares[1]);
  check(VecScale(pair.real, 1 / size));
  check(VecScale(pair.imaginary, 1 / size));
  pair.backward_error = backward_error(problem, norms, pair);
  return pair;
}

Owned<KSP> static_solver(Mat A)
{
  Owned<KSP> solver;
  PC factor = nullptr;
  check(KSPCreate(comm_of(A), solver.put()));
  check(KSPSetOperators(solver, A, A));
  check(KSPSetType(solver, KSPPREONLY));
  check(KSPGetPC(solver, &factor));
  check(PCSetType(factor, PCCHOLESKY));
  check(PCFactorSetMatSolverType(factor, MATSOLVERMUMPS));
  check(KSPSetOptionsPrefix(solver, "modes_"));
  check(KSPSetFromOptions(solver));
  return solver;
}

// Static answers to the residuals of the first pairs join the basis; true if it grew.
bool correct(Basis& basis, const QuadraticProblem& problem, const std::vector<DenseEigenpair>& found, int candidates,
             Mat M, KSP stiffness)
{
  const QuadraticNorms norms = norms_of(problem);
  std::vector<Owned<Vec>> shapes;
  for (std::size_t k = 0; k < std::min(found.size(), static_cast<std::size_t>(candidates)); ++k)
  {
    const Eigenpair pair = in_problem(basis, problem, norms, found[k]);
    if (pair.backward_error < 1e-15) continue; // solved to rounding
    Owned<Vec> real = zeros_like(pair.real), imaginary = zeros_like(pair.real);
    quadratic_residual(problem.M, problem.C, problem.K, pair.lambda, pair.real, pair.imaginary, real, imaginary);
    for (Owned<Vec>* residual : {&real, &imaginary})
    {
      Owned<Vec> shape = zeros_like(*residual);
      check(KSPSolve(stiffness, *residual, shape));
      shapes.push_back(std::move(shape));
    }
  }
  const PetscInt before = basis.size;
  PetscInt n = 0;
  check(MatGetSize(M, &n, nullptr));
  for (const Owned<Vec>& shape : shapes)
    if (basis.size < n) append(basis, shape, M);
  return basis.size > before;
}

} // namespace

QuadraticSolution solve_projected(const QuadraticProblem& problem, Mat M, Mat K, const RealModes& modes,
                                  const ProjectionSettings& settings)
{
  QuadraticSolution result;
  result.outcome = modes.outcome;
  result.outcome.iterations = 0;
  Basis basis = make_basis(M, modes, 2 * settings.passes * settings.candidates);
  std::vector<DenseEigenpair> found = solve_on(basis, problem, settings.band);
  if (settings.passes > 0)
  {
    const Owned<Mat> A = shifted(M, K, shift_below_zero(M, K));
    const Owned<KSP> stiffness = static_solver(A);
    for (int pass = 0; pass < settings.passes; ++pass)
    {
      if (!correct(basis, problem, found, settings.candidates, M, stiffness)) break;
      found = solve_on(basis, problem, settings.band);
      ++result.outcome.iterations;
    }
  }
  const QuadraticNorms norms = norms_of(problem);
  const double omega_zero = norms.M > 0 ? 1e-6 * std::sqrt(norms.K / norms.M) : 0; // free bodies move, not vibrate
  for (const DenseEigenpair& pair : found)
  {
    if (std::abs(pair.lambda) <= omega_zero) continue;
    result.pairs.push_back(in_problem(basis, problem, norms, pair));
    result.outcome.residual = std::max(result.outcome.residual, result.pairs.back().backward_error);
  }
  std::stable_sort(result.pairs.begin(), result.pairs.end(),
                   [](const Eigenpair& a, const Eigenpair& b) { return a.lambda.real() > b.lambda.real(); });
  return result;
}

} // namespace squeal
