#include "squeal/modes/projection.hpp"

#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/constants.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

/// A matrix A of the problem with A V and V'A V, which grow with V.
struct Projected
{
  Mat matrix = nullptr;
  MultiVector image;
  MatrixXd entries{};
};

/// V has gained its last columns, W: V'A V gains the columns V'(A W) and the rows W'(A V).
void extend(Projected& projected, const MultiVector& V, Index gained)
{
  const MultiVector W = columns_from(V, V.columns() - gained), AW = product(projected.matrix, W);
  const MatrixXd below = inner_products(W, projected.image);
  append(projected.image, AW);
  projected.entries.conservativeResize(V.columns(), V.columns());
  projected.entries.bottomLeftCorner(below.rows(), below.cols()) = below;
  projected.entries.rightCols(gained) = inner_products(V, AW);
}

struct Subspace
{
  MultiVector V;
  Projected M, C, K;
};

/// V gains what X adds to its span. Returns false if that is nothing.
bool extend(Subspace& space, MultiVector X)
{
  PetscInt n = 0;
  check(MatGetSize(space.K.matrix, &n, nullptr));
  if (X.columns() == 0 || space.V.columns() >= n) return false;
  const Index gained = extend_orthonormal(space.V, std::move(X));
  if (gained == 0) return false;
  for (Projected* projected : {&space.M, &space.C, &space.K}) extend(*projected, space.V, gained);
  return true;
}

/// The pairs of the small problem in the window, largest growth ratio first.
std::vector<DenseEigenpair> solve_small(const Subspace& space, const Window& window)
{
  std::vector<DenseEigenpair> found =
      solve_dense_quadratic_shared(space.V.comm, space.M.entries, space.C.entries, space.K.entries);
  std::erase_if(found, [&](const DenseEigenpair& pair) { return !window.holds(pair.lambda); });
  std::sort(found.begin(), found.end(),
            [](const DenseEigenpair& a, const DenseEigenpair& b)
            { return a.lambda.real() * std::abs(b.lambda) > b.lambda.real() * std::abs(a.lambda); });
  return found;
}

constexpr std::size_t at_once = 64; // pairs expanded at a time
constexpr double critical = -1e-3;  // growth ratio
using Pairs = std::span<const DenseEigenpair>;

/// lambda^power y of each pair: the real parts of all, then the imaginary parts.
MatrixXd coefficients(Pairs pairs, int power)
{
  const auto count = static_cast<Index>(pairs.size());
  MatrixXd result(pairs.front().y.size(), 2 * count);
  for (Index k = 0; k < count; ++k)
  {
    const DenseEigenpair& pair = pairs[static_cast<std::size_t>(k)];
    const Eigen::VectorXcd column = std::pow(pair.lambda, power) * pair.y;
    result.col(k) = column.real();
    result.col(count + k) = column.imag();
  }
  return result;
}

/// Appends the pairs y = V a to `solution` and, of their residuals, those that are not small enough to `residuals`.
void expand(const Subspace& space, const QuadraticNorms& norms, Pairs pairs, const Correction& correction,
            std::vector<Eigenpair>& solution, MultiVector& residuals)
{
  const auto count = static_cast<Index>(pairs.size());
  const MatrixXd a = coefficients(pairs, 0);
  const MultiVector y = combination(space.V, a);
  MultiVector residual = combination(space.K.image, a);
  residual.entries.noalias() += space.C.image.entries * coefficients(pairs, 1);
  residual.entries.noalias() += space.M.image.entries * coefficients(pairs, 2);
  const Eigen::VectorXd left = column_norms(residual);
  std::vector<Index> kept;
  for (Index k = 0; k < count; ++k)
  {
    const std::complex<double> lambda = pairs[static_cast<std::size_t>(k)].lambda;
    const double w = std::abs(lambda), scale = w * w * norms.M + w * norms.C + norms.K;
    Eigenpair pair{lambda, {}, {}, std::hypot(left(k), left(count + k)) / scale};
    check(MatCreateVecs(space.K.matrix, pair.real.put(), pair.imaginary.put()));
    copy_column(y, k, pair.real);
    copy_column(y, count + k, pair.imaginary);
    solution.push_back(std::move(pair));
    const double tolerance = lambda.real() > critical * w ? correction.sharp : correction.tolerance;
    for (const Index column : {k, count + k})
      if (left(column) > tolerance * scale) kept.push_back(column);
  }
  append(residuals, {residual.comm, residual.entries(Eigen::all, kept)});
}

/// An orthonormal basis of the residuals' directions, down to `share` of the largest. No column counts for more than
/// 30 times the median: a combination of corrections that is no pair but is in the window would outweigh all others.
MultiVector largest_directions(MultiVector residuals, double share)
{
  constexpr double outstanding = 30;
  if (share == 0) return residuals;
  const Eigen::VectorXd sizes = column_norms(residuals);
  std::vector<double> sorted(sizes.begin(), sizes.end());
  const auto middle = sorted.begin() + residuals.columns() / 2;
  std::nth_element(sorted.begin(), middle, sorted.end());
  for (Index j = 0; j < residuals.columns(); ++j)
    if (sizes(j) > outstanding * *middle) residuals.entries.col(j) *= outstanding * *middle / sizes(j);
  orthonormalise(residuals, share * share);
  return residuals;
}

} // namespace

QuadraticSolution solve_on_subspace(const QuadraticProblem& problem, MultiVector basis, const PencilFactor& P,
                                    const Correction& correction)
{
  QuadraticSolution result;
  const QuadraticNorms norms = norms_of(problem);
  const MultiVector none = empty_multivector(problem.K);
  Subspace space{none, {problem.M, none, {}}, {problem.C, none, {}}, {problem.K, none, {}}};
  extend(space, std::move(basis));
  for (int pass = 0;; ++pass)
  {
    const std::vector<DenseEigenpair> found = solve_small(space, correction.window);
    MultiVector residuals = none;
    result.pairs.clear();
    const auto expand_until = [&](std::size_t end)
    {
      for (std::size_t first = result.pairs.size(); first < end; first = result.pairs.size())
        expand(space, norms, Pairs(found).subspan(first, std::min(at_once, end - first)), correction, result.pairs,
               residuals);
    };
    if (pass < correction.passes) expand_until(std::min(found.size(), static_cast<std::size_t>(correction.pairs)));
    const bool better = pass < correction.passes && residuals.columns() > 0 &&
                        extend(space, P.solve(largest_directions(std::move(residuals), correction.share)));
    result.outcome.iterations = pass + better;
    if (better) continue;
    expand_until(found.size());
    sort_and_measure(result);
    return result;
  }
}

QuadraticSolution solve_projected(const QuadraticProblem& problem, Mat M, Mat K, const RealModes& modes,
                                  const ProjectionSettings& settings)
{
  QuadraticSolution result;
  if (!modes.shapes.empty())
  {
    MultiVector shapes = empty_multivector(K);
    for (const Owned<Vec>& shape : modes.shapes) append(shapes, shape);
    ShiftInvert stiffness = make_shift_invert(K, M, Symmetry::symmetric, settings.pencil);
    if (settings.passes > 0) move_to(stiffness, shift_below_zero(M, K));
    const double omega = two_pi * settings.band;
    const Window window{vibration_floor(norms_of(problem)), omega * omega};
    result = solve_on_subspace(problem, std::move(shapes), *stiffness.factor,
                               {window, settings.passes, settings.candidates, 1e-15, 1e-15, 0});
  }
  result.outcome.kind = modes.outcome.kind;
  result.outcome.reason = modes.outcome.reason;
  return result;
}

} // namespace squeal
