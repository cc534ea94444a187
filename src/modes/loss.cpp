#include "loss.hpp"

#include "complex_subspace.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/modes/two_sided.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

constexpr int passes = 30;          // of residual correction, at most: losses of 2 and more take over 12
constexpr double tolerance = 1e-13; // backward error
constexpr double share = 1e-3;      // directions of residuals below this part of the largest are left to later passes

/// A mode with its backward error in the whole problem.
struct CorrectedMode
{
  DenseEigenpair pair;
  double error = HUGE_VAL;
  std::optional<Complex> drawn_to{}; // the lambda of another mode, which Newton's method led it to
};

using Group = std::vector<CorrectedMode>;

/// The rows of a vector that a larger space has too.
void widen(VectorXcd& a, Index columns)
{
  const Index known = a.size();
  a.conservativeResize(columns);
  a.tail(columns - known).setZero();
}

/// Makes the pairs that are not exact those of the problem on the subspace, each once. Returns which of them it found;
/// the others stay what they were.
std::vector<char> solve_on_subspace(const LossyMatrices& problem, Group& group)
{
  constexpr double near = 1e-5, far = 1e-3; // of lambda: what may draw a pair to itself, what it cannot be
  std::vector<char> found(group.size(), 0);
  std::vector<DenseEigenpair> solved;
  const auto is_known = [&](const DenseEigenpair& pair, const Sameness& limits)
  { return std::ranges::any_of(solved, [&](const DenseEigenpair& other) { return are_one(other, pair, limits); }); };
  for (CorrectedMode& mode : group)
    if (mode.error <= tolerance) solved.push_back(mode.pair);
  for (std::size_t k = 0; k < group.size(); ++k)
  {
    CorrectedMode& mode = group[k];
    if (mode.error <= tolerance) continue;
    DenseEigenpair pair = mode.pair;
    if (!solve_lossy(problem, pair)) continue;
    if (is_known(pair, perhaps))
    {
      const auto distance = [&](const DenseEigenpair& other)
      { return std::abs(other.lambda - pair.lambda) / std::abs(pair.lambda); };
      std::vector<DenseEigenpair> others;
      std::ranges::copy_if(solved, std::back_inserter(others),
                           [&](const DenseEigenpair& other) { return distance(other) < near; });
      DenseEigenpair beside = mode.pair;
      if (solve_lossy_beside(problem, others, beside) && distance(beside) < far && !is_known(beside, perhaps))
        pair = std::move(beside);
      else if (is_known(pair, {}))
      {
        mode.drawn_to = pair.lambda;
        continue;
      }
    }
    found[k] = 1;
    solved.push_back(pair);
    mode.pair = std::move(pair);
  }
  return found;
}

/// Solves the modes on the subspace; residuals that are not small join it, until none is left. What is
/// exact stays so, since the subspace only grows.
void solve_group(ComplexSubspace& space, Group& group, const PencilFactor& P)
{
  for (int pass = 0;; ++pass)
  {
    end_if_asked(space.V.comm);
    for (CorrectedMode& mode : group) mode.drawn_to.reset();
    MultiVector residuals{space.V.comm, MatrixXd(space.V.entries.rows(), 0)};
    for (CorrectedMode& mode : group) widen(mode.pair.y, space.V.columns());
    const std::vector<char> found = solve_on_subspace(space.entries, group);
    for (std::size_t k = 0; k < group.size(); ++k)
    {
      const auto& [lambda, y] = group[k].pair;
      double& error = group[k].error;
      if (error <= tolerance) continue;
      error = HUGE_VAL;
      if (!found[k]) continue;
      const MultiVector residual = residual_of(space, loss_factors(lambda), y, error);
      if (error > tolerance) append(residuals, residual);
    }
    if (residuals.columns() == 0 || pass == passes) return;
    orthonormalise(residuals, share * share);
    if (!extend(space, P.solve(residuals))) return;
  }
}

/// Whether two pairs of a problem with this matrix are the same. Collective.
bool are_one(const Eigenpair& a, const Eigenpair& b, Mat A)
{
  if (std::abs(a.lambda - b.lambda) >= same_lambda * std::abs(a.lambda)) return false;
  MultiVector of_a = empty_multivector(A), of_b = of_a;
  for (const Vec part : {a.real.get(), a.imaginary.get()}) append(of_a, part);
  for (const Vec part : {b.real.get(), b.imaginary.get()}) append(of_b, part);
  const MatrixXd shared = inner_products(of_b, of_a);
  const double re = shared(0, 0) + shared(1, 1), im = shared(0, 1) - shared(1, 0); // b^H a
  Eigen::Matrix2d times;                                                           // (b_real, b_imaginary) by b^H a
  times << re, im, -im, re;
  of_a.entries -= of_b.entries * times;
  return column_norms(of_a).norm() < same_vector;
}

/// The lambda of a pair that stands twice, if there is any. Collective.
std::optional<Complex> doubled(const std::vector<Eigenpair>& pairs, Mat A)
{
  for (std::size_t k = 1; k < pairs.size(); ++k)
    for (std::size_t l = 0; l < k; ++l)
      if (are_one(pairs[l], pairs[k], A)) return pairs[k].lambda;
  return std::nullopt;
}

/// Pairs with losses.
struct LossyPairs
{
  std::vector<Eigenpair> pairs{};
  std::optional<Complex> doubled{}; // the lambda of two modes
};

/// Solves groups of at most so many pairs.
LossyPairs solve_in_groups(const std::vector<Eigenpair>& without_losses, const ComplexSubspace& empty,
                           ShiftInvert& pencil, std::size_t in_group)
{
  LossyPairs result;
  std::vector<Complex> eigenvalues;
  for (const Eigenpair& pair : without_losses)
  {
    eigenvalues.push_back(pair.lambda);
    result.pairs.push_back({pair.lambda, copy_of(pair.real), copy_of(pair.imaginary), pair.backward_error});
  }
  for (const auto& [places, first, end] : neighbouring_pairs(eigenvalues, in_group))
  {
    ComplexSubspace space = empty;
    MultiVector shapes = empty.V;
    for (const std::size_t place : places)
      for (const Vec part : {without_losses[place].real.get(), without_losses[place].imaginary.get()})
        append(shapes, part);
    extend(space, shapes);
    const MatrixXd a = inner_products(space.V, shapes);
    std::vector<DenseEigenpair> without;
    for (std::size_t k = 0; k < places.size(); ++k)
    {
      const auto column = static_cast<Index>(2 * k);
      const VectorXcd y = a.col(column).cast<Complex>() + Complex(0, 1) * a.col(column + 1);
      without.push_back({eigenvalues[places[k]], y.normalized()});
    }
    const std::vector<DenseEigenpair> with = with_losses(space.entries, without);
    Group group;
    for (std::size_t k = first; k < end; ++k) group.push_back({with[k]});
    const double middle = eigenvalues[places[(first + end - 1) / 2]].imag();
    move_to(pencil, 1.0001 * middle * middle);
    solve_group(space, group, *pencil.factor);
    for (std::size_t k = first; k < end; ++k)
    {
      Eigenpair& pair = result.pairs[places[k]];
      const CorrectedMode& mode = group[k - first];
      const DenseEigenpair& own = mode.pair;
      const MultiVector y = vector_of(space, own.y);
      copy_column(y, 0, pair.real);
      copy_column(y, 1, pair.imaginary);
      pair.lambda = own.lambda;
      pair.backward_error = mode.error;
      if (mode.drawn_to) result.doubled = mode.drawn_to;
    }
  }
  return result;
}

} // namespace

void correct_loss(QuadraticSolution& solution, const QuadraticProblem& problem, Mat K_loss,
                  const PencilOptions& options)
{
  const ComplexSubspace empty = empty_subspace({problem.M, problem.C, problem.K, K_loss});
  ShiftInvert pencil = make_shift_invert(problem.K, problem.M, Symmetry::none, options);
  LossyPairs found;
  for (const std::size_t in_group : {usual_group, largest_group})
  {
    found = {}; // before others take memory
    found = solve_in_groups(solution.pairs, empty, pencil, in_group);
    if (!found.doubled) found.doubled = doubled(found.pairs, problem.K);
    if (!found.doubled) break;
  }
  solution.pairs = std::move(found.pairs);
  if (found.doubled && solution.outcome.kind == OutcomeKind::converged)
  {
    solution.outcome.kind = OutcomeKind::not_converged;
    solution.outcome.reason = describe_doubled(*found.doubled);
  }
  solution.outcome.residual = 0;
  for (const Eigenpair& pair : solution.pairs)
    solution.outcome.residual = std::max(solution.outcome.residual, pair.backward_error);
}

} // namespace squeal
