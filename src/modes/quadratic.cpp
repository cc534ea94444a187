#include "squeal/modes/quadratic.hpp"

#include "squeal/algebra/quadratic_residual.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Scales y to 2-norm 1.
void normalise(Eigenpair& pair)
{
  double a = 0, b = 0;
  check(VecNorm(pair.real, NORM_2, &a));
  check(VecNorm(pair.imaginary, NORM_2, &b));
  const double norm = std::hypot(a, b);
  check(VecScale(pair.real, 1 / norm));
  check(VecScale(pair.imaginary, 1 / norm));
}

Owned<Mat> scaled(Mat A, double factor)
{
  Owned<Mat> result = copy_of(A);
  check(MatScale(result, factor));
  return result;
}

/// What counts the solves of TOAR and shows their number, and the exception of a call.
struct Watch
{
  MPI_Comm comm;
  Progress progress;
  int solves = 0;
  std::exception_ptr failure{};
};

PetscErrorCode watch_solve(KSP, Vec, Vec, void* context)
{
  Watch& watch = *static_cast<Watch*>(context);
  return guarded(watch.failure,
                 [&]
                 {
                   end_if_asked(watch.comm);
                   ++watch.solves;
                   watch.progress.update(watch.solves, format("by Arnoldi's method, %d solves", watch.solves));
                 });
}

Owned<PEP> make_solver(Mat M, Mat C, Mat K, PetscInt count, double shift, Watch& watch)
{
  Owned<PEP> pep;
  check(PEPCreate(comm_of(K), pep.put()));
  Mat coefficients[3] = {K, C, M};
  check(PEPSetOperators(pep, 3, coefficients));
  check(PEPSetProblemType(pep, PEP_GENERAL));
  check(PEPSetType(pep, PEPTOAR));
  check(PEPSetWhichEigenpairs(pep, PEP_TARGET_MAGNITUDE));
  check(PEPSetTarget(pep, shift));
  check(PEPSetDimensions(pep, count, PETSC_DEFAULT, PETSC_DEFAULT));
  check(PEPSetTolerances(pep, 1e-11, 200));
  ST transformation = nullptr;
  check(PEPGetST(pep, &transformation));
  use_mumps(transformation);
  KSP solver = nullptr;
  check(STGetKSP(transformation, &solver));
  check(KSPSetPreSolve(solver, watch_solve, &watch));
  check(PEPSetOptionsPrefix(pep, "modes_"));
  check(PEPSetFromOptions(pep));
  return pep;
}

/// Appends the pairs of a solved PEP in the window. Returns the largest |nu - shift| of all.
double collect(PEP pep, double omega, double shift, const Window& window, std::vector<Eigenpair>& pairs)
{
  PetscInt converged = 0;
  check(PEPGetConverged(pep, &converged));
  Mat K = nullptr;
  check(PEPGetOperators(pep, 0, &K));
  double farthest = 0;
  for (PetscInt i = 0; i < converged; ++i)
  {
    Eigenpair pair;
    PetscScalar re = 0, im = 0;
    check(MatCreateVecs(K, pair.real.put(), pair.imaginary.put()));
    check(PEPGetEigenpair(pep, i, &re, &im, pair.real, pair.imaginary));
    farthest = std::max(farthest, std::hypot(re - shift, im));
    pair.lambda = omega * std::complex<double>(re, im);
    if (window.holds(pair.lambda)) pairs.push_back(std::move(pair));
  }
  return farthest;
}

/// By TOAR, with twice as many eigenvalues in each attempt until they reach the end of the band.
QuadraticSolution solve_by_toar(const QuadraticProblem& problem, const QuadraticSettings& settings,
                                const Window& window)
{
  PetscInt n = 0;
  check(MatGetSize(problem.K, &n, nullptr));
  const double omega = std::sqrt(window.limit);
  const Owned<Mat> M = scaled(problem.M, omega * omega), C = scaled(problem.C, omega);
  QuadraticSolution result;
  PetscInt count = std::min<PetscInt>(2 * settings.expected + 20, 2 * n);
  for (int attempt = 0; attempt < 6; ++attempt)
  {
    Watch watch{comm_of(problem.K), {comm_of(problem.K), "modes", 2. * count}};
    const Owned<PEP> pep = make_solver(M, C, problem.K, count, settings.shift, watch);
    check_after_callbacks(PEPSolve(pep), watch.failure);
    PetscInt iterations = 0, converged = 0;
    check(PEPGetIterationNumber(pep, &iterations));
    check(PEPGetConverged(pep, &converged));
    result.pairs.clear();
    const double farthest = collect(pep, omega, settings.shift, window, result.pairs);
    result.outcome.iterations += static_cast<int>(iterations);
    result.outcome.kind = OutcomeKind::converged;
    result.outcome.reason.clear();
    if (farthest >= 1 + std::abs(settings.shift) || converged >= 2 * n) return result;
    result.outcome.kind = OutcomeKind::not_converged;
    result.outcome.reason =
        std::to_string(converged) + " eigenvalues reach " + std::to_string(farthest * omega / two_pi) + " Hz only";
    if (converged < count) break;
    count = std::min<PetscInt>(2 * count, 2 * n);
  }
  return result;
}

} // namespace

Owned<Mat> without_loss(Mat C, const Structure& structure)
{
  Owned<Mat> result = copy_of(C);
  check(MatAXPY(result, -1 / structure.loss_omega, structure.K_loss, UNKNOWN_NONZERO_PATTERN));
  return result;
}

Owned<Mat> sliding_loss(const Structure& structure, const LinearisedSliding& linearised)
{
  if (!structure.K_loss.get()) return {};
  return project(structure.K_loss, linearised.contact.Y, linearised.contact.Z);
}

QuadraticProblem sliding_problem(const Structure& structure, const LinearisedSliding& linearised)
{
  const Mat Y = linearised.contact.Y, Z = linearised.contact.Z;
  const Owned<Mat> C_0 = structure.K_loss.get() ? without_loss(linearised.C, structure) : Owned<Mat>{};
  return {project(structure.M, Y, Z), project(C_0.get() ? C_0.get() : linearised.C.get(), Y, Z),
          project(linearised.K.get() ? linearised.K.get() : structure.K.get(), Y, Z)};
}

bool Window::holds(std::complex<double> lambda) const
{
  const double square = std::norm(lambda);
  return square >= least && square < limit && (lambda.imag() > 0 || (lambda.imag() == 0 && lambda.real() > 0));
}

QuadraticSolution solve_quadratic(const QuadraticProblem& problem, const QuadraticSettings& settings)
{
  const QuadraticNorms norms = norms_of(problem);
  const double omega = two_pi * settings.band;
  const Window window{vibration_floor(norms), omega * omega};
  QuadraticSolution result = solve_by_toar(problem, settings, window);
  for (Eigenpair& pair : result.pairs)
  {
    normalise(pair);
    pair.backward_error = backward_error(problem, norms, pair);
  }
  sort_and_measure(result);
  return result;
}

void sort_and_measure(QuadraticSolution& solution)
{
  for (const Eigenpair& pair : solution.pairs)
    solution.outcome.residual = std::max(solution.outcome.residual, pair.backward_error);
  std::stable_sort(solution.pairs.begin(), solution.pairs.end(),
                   [](const Eigenpair& a, const Eigenpair& b) { return a.lambda.real() > b.lambda.real(); });
}

QuadraticNorms norms_of(const QuadraticProblem& problem)
{
  QuadraticNorms norms;
  check(MatNorm(problem.M, NORM_1, &norms.M));
  check(MatNorm(problem.C, NORM_1, &norms.C));
  check(MatNorm(problem.K, NORM_1, &norms.K));
  return norms;
}

double vibration_floor(const QuadraticNorms& norms)
{
  return norms.M > 0 ? 1e-12 * norms.K / norms.M : 0;
}

double backward_error(const QuadraticProblem& problem, const QuadraticNorms& norms, const Eigenpair& pair)
{
  const Owned<Vec> r = zeros_like(pair.real), s = zeros_like(pair.real);
  quadratic_residual({problem.M, problem.C, problem.K}, pair.lambda, {pair.real, pair.imaginary}, {r, s});
  double residual[2], size[2];
  check(VecNorm(r, NORM_2, &residual[0]));
  check(VecNorm(s, NORM_2, &residual[1]));
  check(VecNorm(pair.real, NORM_2, &size[0]));
  check(VecNorm(pair.imaginary, NORM_2, &size[1]));
  const double lambda = std::abs(pair.lambda), scale = lambda * lambda * norms.M + lambda * norms.C + norms.K;
  return std::hypot(residual[0], residual[1]) / (scale * std::hypot(size[0], size[1]));
}

} // namespace squeal
