#include "squeal/modes/quadratic.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/algebra/sparse_matrices.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace squeal
{

namespace
{

/// Scales y to 2-norm 1.
void normalise(Eigenpair& pair)
{
  const double norm = std::hypot(norm_of(pair.real, NORM_2), norm_of(pair.imaginary, NORM_2));
  check(VecScale(pair.real, 1 / norm));
  check(VecScale(pair.imaginary, 1 / norm));
}

Owned<Mat> scaled(Mat A, double factor)
{
  Owned<Mat> result = copy_of(A);
  check(MatScale(result, factor));
  return result;
}

/// The counter of TOAR's solves, which it shows, and the exception of a call.
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
  const PetscInt n = row_count(problem.K);
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
  return square >= least && square < limit &&
         (lambda.imag() > 0 || (lambda.imag() == 0 && (has_decays || lambda.real() > 0)));
}

QuadraticSolution solve_quadratic(const QuadraticProblem& problem, const QuadraticSettings& settings)
{
  const QuadraticNorms norms = norms_of(problem);
  const double omega = two_pi * settings.band;
  const Window window{vibration_floor(norms), omega * omega, true};
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
  return {norm_of(problem.M, NORM_1), norm_of(problem.C, NORM_1), norm_of(problem.K, NORM_1)};
}

double vibration_floor(const QuadraticNorms& norms)
{
  return norms.M > 0 ? 1e-12 * norms.K / norms.M : 0;
}

double backward_error(const QuadraticProblem& problem, const QuadraticNorms& norms, const Eigenpair& pair)
{
  const Owned<Vec> r = zeros_like(pair.real), s = zeros_like(pair.real);
  quadratic_residual({problem.M, problem.C, problem.K}, pair.lambda, {pair.real, pair.imaginary}, {r, s});
  const double residual = std::hypot(norm_of(r, NORM_2), norm_of(s, NORM_2)),
               size = std::hypot(norm_of(pair.real, NORM_2), norm_of(pair.imaginary, NORM_2));
  const double lambda = std::abs(pair.lambda), scale = lambda * lambda * norms.M + lambda * norms.C + norms.K;
  return residual / (scale * size);
}

using Eigen::MatrixXcd;

Complex loss_factor_of(Complex lambda)
{
  return {0, lambda.imag() > 0 ? 1. : 0.};
}

ComplexFactors loss_factors(Complex lambda)
{
  return {lambda * lambda, lambda, 1, loss_factor_of(lambda)};
}

MatrixXcd sum(const LossyMatrices& A, const ComplexFactors& factors)
{
  MatrixXcd result = factors[0] * A[0];
  for (std::size_t k = 1; k < A.size(); ++k)
    if (A[k].size() > 0) result += factors[k] * A[k];
  return result;
}

namespace
{

constexpr double oscillating = 1e-6; // Im(lambda) over |lambda|: below it is the rounding of two real ones

const auto oscillates = [](const auto& pair) { return pair.lambda.imag() > oscillating * std::abs(pair.lambda); };

/// Drops the pairs that real eigenvalues become under losses. Where there are more pairs than oscillate without losses,
/// they are the unmatched pairs nearest to a real one.
void drop_real(std::vector<DenseEigenpair>& pairs, const std::vector<DenseEigenpair>& without)
{
  std::vector<Complex> vibrating, all;
  for (const DenseEigenpair& pair : without)
    if (oscillates(pair)) vibrating.push_back(pair.lambda);
  if (vibrating.size() == without.size() || pairs.size() <= vibrating.size()) return;
  for (const DenseEigenpair& pair : pairs) all.push_back(pair.lambda);
  const std::vector<std::size_t> theirs = nearest_places(vibrating, all);
  std::vector<DenseEigenpair> kept;
  for (std::size_t k = 0; k < pairs.size(); ++k)
  {
    const auto distance = [&](const DenseEigenpair& other) { return std::abs(other.lambda - pairs[k].lambda); };
    if (std::ranges::count(theirs, k) > 0 || oscillates(*std::ranges::min_element(without, {}, distance)))
      kept.push_back(std::move(pairs[k]));
  }
  pairs = std::move(kept);
}

} // namespace

std::vector<DenseEigenpair> solve_lossy_shared(MPI_Comm comm, const LossyMatrices& problem, Vectors which, double limit)
{
  const auto& [M, C, K, K_loss] = problem;
  std::vector<DenseEigenpair> without = solve_dense_quadratic_shared(comm, M, C, K, which, limit);
  if (K_loss.size() == 0) return without;
  std::vector<DenseEigenpair> pairs =
      solve_dense_quadratic_shared(comm, MatrixXcd(M.cast<Complex>()), MatrixXcd(C.cast<Complex>()),
                                   MatrixXcd(K + Complex(0, 1) * K_loss), which, limit);
  drop_real(pairs, without);
  std::ranges::copy_if(without, std::back_inserter(pairs), std::not_fn(oscillates));
  return pairs;
}

} // namespace squeal
