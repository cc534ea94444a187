#include "squeal/analysis/projection.hpp"

#include "squeal/analysis/shift_invert.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

using Index = std::size_t;

// The problem's matrices and their projections on V, which grow with it.
struct Projected
{
  Owned<Mat> transposed;
  Mat matrix = nullptr;
  std::vector<double> entries; // V'A V
};

Projected start_projection(Mat A)
{
  Projected result;
  result.matrix = A;
  check(MatTranspose(A, MAT_INITIAL_MATRIX, result.transposed.put()));
  return result;
}

// V has gained its last columns, W: V'A V gains the columns V'(A W) and the rows W'A V = (V'(A'W))'.
void extend(Projected& projected, const Block& V, PetscInt gained)
{
  const Block W = columns_from(V, V.columns - gained);
  const std::vector<double> right = inner(V, product(projected.matrix, W));
  const std::vector<double> left = inner(V, product(projected.transposed, W));
  const auto size = static_cast<Index>(V.columns), fresh = static_cast<Index>(gained), before = size - fresh;
  std::vector<double> entries(size * size);
  for (Index j = 0; j < before; ++j)
  {
    std::copy_n(projected.entries.begin() + static_cast<std::ptrdiff_t>(j * before), before,
                entries.begin() + static_cast<std::ptrdiff_t>(j * size));
    for (Index i = 0; i < fresh; ++i) entries[before + i + j * size] = left[j + i * size];
  }
  std::copy(right.begin(), right.end(), entries.begin() + static_cast<std::ptrdiff_t>(before * size));
  projected.entries = std::move(entries);
}

struct Subspace
{
  Block V;
  Projected M, C, K;
};

void extend(Subspace& space, PetscInt gained)
{
  for (Projected* projected : {&space.M, &space.C, &space.K}) extend(*projected, space.V, gained);
}

// The pairs of the small problem in the window, largest growth ratio first.
std::vector<DenseEigenpair> solve_on(const Subspace& space, const Window& window)
{
  std::vector<DenseEigenpair> found = solve_dense_quadratic_shared(space.V.comm, static_cast<int>(space.V.columns),
                                                                   space.M.entries, space.C.entries, space.K.entries);
  std::erase_if(found, [&](const DenseEigenpair& pair) { return !window.holds(pair.lambda); });
  std::sort(found.begin(), found.end(),
            [](const DenseEigenpair& a, const DenseEigenpair& b)
            { return a.lambda.real() * std::abs(b.lambda) > b.lambda.real() * std::abs(a.lambda); });
  return found;
}

// y = V a of some pairs, of 2-norm 1, and their residuals and backward errors: real parts, then imaginary ones.
struct Expanded
{
  Block y, residual;
  std::vector<double> backward_error;
};

// A y times the power of lambda that goes with A, added to the residuals
void add_term(Block& residual, const Block& Ay, const std::vector<std::complex<double>>& factor)
{
  const auto pairs = static_cast<PetscInt>(factor.size());
  for (PetscInt k = 0; k < pairs; ++k)
  {
    const double re = factor[static_cast<Index>(k)].real(), im = factor[static_cast<Index>(k)].imag();
    const double *a = Ay.column(k), *b = Ay.column(pairs + k);
    double *r = residual.column(k), *s = residual.column(pairs + k);
    for (PetscInt i = 0; i < Ay.rows; ++i)
    {
      r[i] += re * a[i] - im * b[i];
      s[i] += im * a[i] + re * b[i];
    }
  }
}

// `y`: of some length; made 1.
Expanded expand(const QuadraticProblem& problem, const QuadraticNorms& norms,
                const std::vector<std::complex<double>>& lambda, Block y)
{
  const Index count = lambda.size();
  const std::vector<double> length = column_norms(y);
  std::vector<std::complex<double>> square;
  for (Index k = 0; k < count; ++k)
  {
    square.push_back(lambda[k] * lambda[k]);
    for (const Index column : {k, count + k})
      std::transform(y.column(static_cast<PetscInt>(column)), y.column(static_cast<PetscInt>(column)) + y.rows,
                     y.column(static_cast<PetscInt>(column)),
                     [&](double entry) { return entry / std::hypot(length[k], length[count + k]); });
  }
  Expanded result;
  result.y = std::move(y);
  result.residual = product(problem.K, result.y);
  add_term(result.residual, product(problem.C, result.y), lambda);
  add_term(result.residual, product(problem.M, result.y), square);
  const std::vector<double> left = column_norms(result.residual);
  for (Index k = 0; k < count; ++k)
  {
    const double w = std::abs(lambda[k]), scale = w * w * norms.M + w * norms.C + norms.K;
    result.backward_error.push_back(std::hypot(left[k], left[count + k]) / scale);
  }
  return result;
}

// y = V a
Expanded expand(const QuadraticProblem& problem, const QuadraticNorms& norms, const Block& V,
                const DenseEigenpair* pairs, Index count)
{
  std::vector<double> re, im;
  std::vector<std::complex<double>> lambda;
  for (const DenseEigenpair* pair = pairs; pair != pairs + count; ++pair)
  {
    for (const std::complex<double>& a : pair->y)
    {
      re.push_back(a.real());
      im.push_back(a.imag());
    }
    lambda.push_back(pair->lambda);
  }
  re.insert(re.end(), im.begin(), im.end());
  return expand(problem, norms, lambda, combination(V, re, static_cast<PetscInt>(2 * count)));
}

void append_pairs(const QuadraticProblem& problem, const std::vector<std::complex<double>>& lambda,
                  const Expanded& expanded, std::vector<Eigenpair>& pairs)
{
  const auto count = static_cast<PetscInt>(lambda.size());
  for (PetscInt k = 0; k < count; ++k)
  {
    const auto i = static_cast<Index>(k);
    Eigenpair pair{lambda[i], {}, {}, expanded.backward_error[i]};
    check(MatCreateVecs(problem.K, pair.real.put(), pair.imaginary.put()));
    copy_column(expanded.y, k, pair.real);
    copy_column(expanded.y, count + k, pair.imaginary);
    pairs.push_back(std::move(pair));
  }
}

constexpr Index at_once = 64; // pairs expanded at a time

// Answers to the residuals of the first pairs join the space; false if nothing new came of them.
bool correct(Subspace& space, const QuadraticProblem& problem, const QuadraticNorms& norms,
             const std::vector<DenseEigenpair>& found, int most, Mat stiffness)
{
  Block residuals = empty_block(problem.K);
  const Index candidates = std::min(found.size(), static_cast<Index>(most));
  for (Index first = 0; first < candidates; first += at_once)
  {
    const Index count = std::min(at_once, candidates - first);
    const Expanded pairs = expand(problem, norms, space.V, found.data() + first, count);
    for (Index k = 0; k < count; ++k)
      if (pairs.backward_error[k] > 1e-15) // not solved to rounding
        for (const Index column : {k, count + k})
        {
          const double* r = pairs.residual.column(static_cast<PetscInt>(column));
          residuals.entries.insert(residuals.entries.end(), r, r + residuals.rows);
          ++residuals.columns;
        }
  }
  if (residuals.columns == 0) return false;
  PetscInt n = 0;
  check(MatGetSize(problem.K, &n, nullptr));
  if (space.V.columns >= n) return false;
  const PetscInt gained = extend_orthonormal(space.V, solved(stiffness, residuals));
  if (gained > 0) extend(space, gained);
  return gained > 0;
}

} // namespace

std::vector<Eigenpair> eigenpairs(const QuadraticProblem& problem, const std::vector<std::complex<double>>& lambda,
                                  const ComplexBlock& y)
{
  Block parts = y.re;
  append(parts, y.im);
  std::vector<Eigenpair> pairs;
  append_pairs(problem, lambda, expand(problem, norms_of(problem), lambda, std::move(parts)), pairs);
  return pairs;
}

QuadraticSolution solve_projected(const QuadraticProblem& problem, Mat M, Mat K, const RealModes& modes,
                                  const ProjectionSettings& settings)
{
  QuadraticSolution result;
  result.outcome = modes.outcome;
  result.outcome.iterations = 0;
  result.outcome.residual = 0;
  if (modes.shapes.empty()) return result;
  const QuadraticNorms norms = norms_of(problem);
  const double omega = 2 * std::numbers::pi * settings.band;
  const Window window{vibration_floor(norms), omega * omega};
  Subspace space{empty_block(K), start_projection(problem.M), start_projection(problem.C), start_projection(problem.K)};
  Block shapes = empty_block(K);
  for (const Owned<Vec>& shape : modes.shapes) append(shapes, shape);
  extend(space, extend_orthonormal(space.V, std::move(shapes)));
  ShiftInvert stiffness = make_shift_invert(K, M);
  if (settings.passes > 0) move_to(stiffness, shift_below_zero(M, K));
  std::vector<DenseEigenpair> found = solve_on(space, window);
  for (int pass = 0; pass < settings.passes; ++pass)
  {
    if (!correct(space, problem, norms, found, settings.candidates, stiffness.factor)) break;
    found = solve_on(space, window);
    ++result.outcome.iterations;
  }
  for (Index first = 0; first < found.size(); first += at_once)
  {
    const Index count = std::min(at_once, found.size() - first);
    std::vector<std::complex<double>> lambda;
    for (Index k = 0; k < count; ++k) lambda.push_back(found[first + k].lambda);
    append_pairs(problem, lambda, expand(problem, norms, space.V, found.data() + first, count), result.pairs);
  }
  settle(result);
  return result;
}

} // namespace squeal
