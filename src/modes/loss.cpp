#include "loss.hpp"

#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/dense_losses.hpp"
#include "squeal/modes/projection.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr int most_corrections = 30;     // of residual correction, at most: losses of 2 and more take over 12
constexpr double loss_tolerance = 1e-13; // backward error
constexpr double waiting_share = 1e-3; // directions of residuals below this part of the largest wait for the next pass
constexpr double independent = 1e-6;   // the same of a first subspace
constexpr double spurious_loss_pair = 1e-8; // backward error of what is no pair
constexpr double near_end = 0.98;           // of the largest |lambda|: pairs from there on may leave the slices
constexpr std::size_t neighbours = 3;       // of a slice's pairs, at each end

/// Pairs of a slice, at most, and how far beyond its ends |lambda| pairs are corrected too, since they may come in.
struct Width
{
  std::size_t pairs = 0;
  double beyond = 0;
};

/// The width that serves, in little time, where modes differ by more than losses change them; and that of a cluster.
constexpr Width usual{16, 0.02}, wide{64, 0.1};

/// X^H A X of the vectors whose real parts come first and whose imaginary parts come next.
MatrixXcd on_vectors(const MultiVector& parts, Mat A)
{
  constexpr Index at_once = 64;
  const Index count = parts.columns() / 2;
  MatrixXd products(2 * count, 2 * count);
  for (Index first = 0; first < 2 * count; first += at_once)
  {
    const Index some = std::min(at_once, 2 * count - first);
    products.middleCols(first, some) =
        inner_products(parts, product(A, {parts.comm, parts.entries.middleCols(first, some)}));
  }
  MatrixXcd result(count, count);
  result.real() = products.topLeftCorner(count, count) + products.bottomRightCorner(count, count);
  result.imag() = products.topRightCorner(count, count) - products.bottomLeftCorner(count, count);
  return result;
}

/// Pairs by their parts: the real parts of all vectors, then the imaginary ones.
struct Starts
{
  MultiVector parts;
  std::vector<DenseEigenpair> pairs{}; // coefficients of the vectors, rising |lambda|

  std::size_t count() const { return pairs.size(); }
  double size(std::size_t k) const { return std::abs(pairs[k].lambda); }
};

/// The pairs with losses on the span of those without, which are taken.
Starts start(std::vector<Eigenpair> without, const QuadraticProblem& problem, Mat K_loss)
{
  Starts starts{empty_multivector(problem.K)};
  for (const auto part : {&Eigenpair::real, &Eigenpair::imaginary})
    for (Eigenpair& pair : without)
    {
      append(starts.parts, pair.*part);
      pair.*part = {};
    }
  const MatrixXcd K = on_vectors(starts.parts, problem.K) + Complex(0, 1) * on_vectors(starts.parts, K_loss);
  starts.pairs = solve_dense_quadratic_shared(starts.parts.comm, on_vectors(starts.parts, problem.M),
                                              on_vectors(starts.parts, problem.C), K);
  std::ranges::sort(starts.pairs, {}, [](const DenseEigenpair& pair) { return std::abs(pair.lambda); });
  return starts;
}

/// An orthonormal basis of the real and imaginary parts of starts from `first` to `end`.
MultiVector basis_of(const Starts& starts, std::size_t first, std::size_t end)
{
  const Index count = starts.parts.columns() / 2, some = static_cast<Index>(end - first);
  MatrixXd a(2 * count, 2 * some);
  for (Index k = 0; k < some; ++k)
  {
    const Eigen::VectorXcd& y = starts.pairs[first + static_cast<std::size_t>(k)].y;
    a.col(k) << y.real(), -y.imag();
    a.col(some + k) << y.imag(), y.real();
  }
  MultiVector basis = combination(starts.parts, a);
  orthonormalise(basis, independent * independent);
  return basis;
}

/// Where a slice from the start `first` on ends: at the widest gap of those that leave it enough pairs.
std::size_t end_of_slice(const Starts& starts, std::size_t first, std::size_t most)
{
  std::size_t end = std::min(first + most, starts.count());
  if (end == starts.count()) return end;
  const auto gap = [&](std::size_t i) { return starts.size(i) / starts.size(i - 1); };
  for (std::size_t i = end - 1; i > first + most / 2; --i)
    if (gap(i) > gap(end)) end = i;
  return end;
}

/// The pairs near the starts, in slices of |lambda|.
std::vector<Eigenpair> solve_in_slices(const Starts& starts, const QuadraticProblem& problem, Mat K_loss,
                                       ShiftInvert& pencil, const Width& width)
{
  std::vector<Eigenpair> result;
  const double beyond = 1 + width.beyond;
  double lower = std::sqrt(vibration_floor(norms_of(problem)));
  for (std::size_t first = 0, end = 0; first < starts.count(); first = end)
  {
    end = end_of_slice(starts, first, width.pairs);
    const double top = starts.size(end - 1),
                 upper = end < starts.count() ? std::sqrt(top * starts.size(end)) : top * beyond;
    std::size_t from = first, to = end;
    while (from > 0 && (first - from < neighbours || starts.size(from - 1) * beyond > lower)) --from;
    while (to < starts.count() && (to - end < neighbours || starts.size(to) < upper * beyond)) ++to;
    move_to(pencil, (lower * lower + upper * upper) / 2);
    const Window window{lower * lower / (beyond * beyond), upper * upper * beyond * beyond};
    const Correction correction{window,         most_corrections, std::numeric_limits<int>::max(),
                                loss_tolerance, loss_tolerance,   waiting_share};
    QuadraticSolution slice =
        solve_on_subspace(problem, K_loss, basis_of(starts, from, to), *pencil.factor, correction);
    std::ranges::copy_if(std::move_iterator(slice.pairs.begin()), std::move_iterator(slice.pairs.end()),
                         std::back_inserter(result),
                         [&](const Eigenpair& pair)
                         {
                           const double size = std::abs(pair.lambda);
                           return size >= lower && size < upper && pair.backward_error <= spurious_loss_pair;
                         });
    lower = upper;
  }
  return result;
}

} // namespace

void correct_loss(QuadraticSolution& solution, const QuadraticProblem& problem, Mat K_loss,
                  const PencilOptions& options)
{
  const auto real = std::stable_partition(solution.pairs.begin(), solution.pairs.end(),
                                          [](const Eigenpair& pair) { return pair.lambda.imag() > 0; });
  std::vector<Eigenpair> without(std::move_iterator(solution.pairs.begin()), std::move_iterator(real));
  solution.pairs.erase(solution.pairs.begin(), real);
  if (!without.empty())
  {
    const std::size_t count = without.size();
    const Starts starts = start(std::move(without), problem, K_loss);
    const auto expected = static_cast<std::size_t>(
        std::ranges::count_if(starts.pairs, [&](const DenseEigenpair& pair)
                              { return std::abs(pair.lambda) < near_end * starts.size(starts.count() - 1); }));
    ShiftInvert pencil = make_shift_invert(problem.K, problem.M, Symmetry::none, options);
    std::vector<Eigenpair> found;
    for (const Width& width : {usual, wide})
    {
      found = solve_in_slices(starts, problem, K_loss, pencil, width);
      if (found.size() >= expected) break;
    }
    if ((found.size() < expected || starts.count() < count) && solution.outcome.kind == OutcomeKind::converged)
    {
      solution.outcome.kind = OutcomeKind::not_converged;
      solution.outcome.reason = format("with loss factors %zu modes were found of %zu", found.size(), count);
    }
    std::ranges::move(found, std::back_inserter(solution.pairs));
  }
  solution.outcome.residual = 0;
  sort_and_measure(solution);
}

} // namespace squeal
