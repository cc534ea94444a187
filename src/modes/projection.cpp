#include "squeal/modes/projection.hpp"

#include "squeal/algebra/shift_invert.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

using Index = std::size_t;

// A matrix of the problem, A V and V'A V, which grow with V.
struct Projected
{
  Mat matrix = nullptr;
  Block image;
  std::vector<double> entries;
};

// V has gained its last columns, W: V'A V gains the columns V'(A W) and the rows W'(A V).
void extend(Projected& projected, const Block& V, PetscInt gained)
{
  const Block W = columns_from(V, V.columns - gained), AW = product(projected.matrix, W);
  const std::vector<double> right = inner(V, AW), left = inner(W, projected.image);
  append(projected.image, AW);
  const auto size = static_cast<Index>(V.columns), fresh = static_cast<Index>(gained), before = size - fresh;
  std::vector<double> entries(size * size);
  for (Index j = 0; j < before; ++j)
  {
    std::copy_n(projected.entries.begin() + static_cast<std::ptrdiff_t>(j * before), before,
                entries.begin() + static_cast<std::ptrdiff_t>(j * size));
    std::copy_n(left.begin() + static_cast<std::ptrdiff_t>(j * fresh), fresh,
                entries.begin() + static_cast<std::ptrdiff_t>(j * size + before));
  }
  std::copy(right.begin(), right.end(), entries.begin() + static_cast<std::ptrdiff_t>(before * size));
  projected.entries = std::move(entries);
}

struct Subspace
{
  Block V;
  Projected M, C, K;
};

// What is new in X joins V; false if nothing is.
bool extend(Subspace& space, Block X)
{
  PetscInt n = 0;
  check(MatGetSize(space.K.matrix, &n, nullptr));
  if (X.columns == 0 || space.V.columns >= n) return false;
  const PetscInt gained = extend_orthonormal(space.V, std::move(X));
  if (gained == 0) return false;
  for (Projected* projected : {&space.M, &space.C, &space.K}) extend(*projected, space.V, gained);
  return true;
}

// The pairs of the small problem in the window, a of 2-norm 1, largest growth ratio first.
std::vector<DenseEigenpair> solve_small(const Subspace& space, const Window& window)
{
  std::vector<DenseEigenpair> found = solve_dense_quadratic_shared(space.V.comm, static_cast<int>(space.V.columns),
                                                                   space.M.entries, space.C.entries, space.K.entries);
  std::erase_if(found, [&](const DenseEigenpair& pair) { return !window.holds(pair.lambda); });
  std::sort(found.begin(), found.end(),
            [](const DenseEigenpair& a, const DenseEigenpair& b)
            { return a.lambda.real() * std::abs(b.lambda) > b.lambda.real() * std::abs(a.lambda); });
  for (DenseEigenpair& pair : found)
  {
    double square = 0;
    for (const std::complex<double>& a : pair.y) square += std::norm(a);
    for (std::complex<double>& a : pair.y) a /= std::sqrt(square);
  }
  return found;
}

constexpr Index at_once = 64;      // pairs expanded at a time
constexpr double critical = -1e-3; // growth ratio
using Pairs = std::span<const DenseEigenpair>;

// lambda^power a of each pair: real parts, then imaginary ones
std::vector<double> coefficients(Pairs pairs, int power)
{
  std::vector<double> re, im;
  for (const DenseEigenpair& pair : pairs)
    for (const std::complex<double>& a : pair.y)
    {
      const std::complex<double> value = std::pow(pair.lambda, power) * a;
      re.push_back(value.real());
      im.push_back(value.imag());
    }
  re.insert(re.end(), im.begin(), im.end());
  return re;
}

// Pairs y = V a join `solution`, and of their residuals what is not good enough joins `residuals`.
void expand(const Subspace& space, const QuadraticNorms& norms, Pairs pairs, const Correction& correction,
            std::vector<Eigenpair>& solution, Block& residuals)
{
  const auto count = static_cast<PetscInt>(pairs.size());
  const std::vector<double> a = coefficients(pairs, 0);
  const Block y = combination(space.V, a, 2 * count);
  Block residual = combination(space.K.image, a, 2 * count);
  add_combination(residual, 1, space.C.image, coefficients(pairs, 1));
  add_combination(residual, 1, space.M.image, coefficients(pairs, 2));
  const std::vector<double> left = column_norms(residual);
  for (PetscInt k = 0; k < count; ++k)
  {
    const std::complex<double> lambda = pairs[static_cast<Index>(k)].lambda;
    const double w = std::abs(lambda), scale = w * w * norms.M + w * norms.C + norms.K;
    const double re = left[static_cast<Index>(k)] / scale, im = left[static_cast<Index>(count + k)] / scale;
    Eigenpair pair{lambda, {}, {}, std::hypot(re, im)};
    check(MatCreateVecs(space.K.matrix, pair.real.put(), pair.imaginary.put()));
    copy_column(y, k, pair.real);
    copy_column(y, count + k, pair.imaginary);
    solution.push_back(std::move(pair));
    const double enough = lambda.real() > critical * w ? correction.sharp : correction.enough;
    for (const auto& [error, column] : {std::pair{re, k}, std::pair{im, count + k}})
    {
      if (error <= enough) continue;
      residuals.entries.insert(residuals.entries.end(), residual.column(column), residual.column(column + 1));
      ++residuals.columns;
    }
  }
}

// Directions down to `share` of the largest. No column counts for more than 30 times the median: a combination of
// corrections that is no pair and happens to lie in the window would outweigh all others.
Block largest_directions(Block residuals, double share)
{
  constexpr double outstanding = 30;
  if (share == 0) return residuals;
  const std::vector<double> sizes = column_norms(residuals);
  std::vector<double> sorted = sizes;
  const auto middle = sorted.begin() + residuals.columns / 2;
  std::nth_element(sorted.begin(), middle, sorted.end());
  for (PetscInt j = 0; j < residuals.columns; ++j)
    if (const double size = sizes[static_cast<Index>(j)]; size > outstanding * *middle)
      std::transform(residuals.column(j), residuals.column(j + 1), residuals.column(j),
                     [&](double entry) { return entry * outstanding * *middle / size; });
  orthonormalise(residuals, share * share);
  return residuals;
}

} // namespace

QuadraticSolution solve_on_subspace(const QuadraticProblem& problem, Block basis, const PencilFactor& P,
                                    const Correction& correction)
{
  QuadraticSolution result;
  const QuadraticNorms norms = norms_of(problem);
  const Block none = empty_block(problem.K);
  Subspace space{none, {problem.M, none, {}}, {problem.C, none, {}}, {problem.K, none, {}}};
  extend(space, std::move(basis));
  for (int pass = 0;; ++pass)
  {
    const std::vector<DenseEigenpair> found = solve_small(space, correction.window);
    Block residuals = none;
    result.pairs.clear();
    const auto expand_until = [&](Index end)
    {
      for (Index first = result.pairs.size(); first < end; first = result.pairs.size())
        expand(space, norms, Pairs(found).subspan(first, std::min(at_once, end - first)), correction, result.pairs,
               residuals);
    };
    if (pass < correction.passes) expand_until(std::min(found.size(), static_cast<Index>(correction.pairs)));
    const bool better = pass < correction.passes && residuals.columns > 0 &&
                        extend(space, P.solved(largest_directions(std::move(residuals), correction.share)));
    result.outcome.iterations = pass + better;
    if (better) continue;
    expand_until(found.size());
    settle(result);
    return result;
  }
}

QuadraticSolution solve_projected(const QuadraticProblem& problem, Mat M, Mat K, const RealModes& modes,
                                  const ProjectionSettings& settings)
{
  QuadraticSolution result;
  if (!modes.shapes.empty())
  {
    Block shapes = empty_block(K);
    for (const Owned<Vec>& shape : modes.shapes) append(shapes, shape);
    ShiftInvert stiffness = make_shift_invert(K, M, Symmetry::symmetric);
    if (settings.passes > 0) move_to(stiffness, shift_below_zero(M, K));
    const double omega = 2 * std::numbers::pi * settings.band;
    const Window window{vibration_floor(norms_of(problem)), omega * omega};
    result = solve_on_subspace(problem, std::move(shapes), *stiffness.factor,
                               {window, settings.passes, settings.candidates, 1e-15, 1e-15, 0});
  }
  result.outcome.kind = modes.outcome.kind;
  result.outcome.reason = modes.outcome.reason;
  return result;
}

} // namespace squeal
