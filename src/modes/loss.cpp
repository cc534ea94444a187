#include "loss.hpp"

#include "complex_subspace.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/two_sided.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
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

/// A mode with the backward errors of both problems.
struct CorrectedMode : LossyMode
{
  double complex_error = HUGE_VAL, viscous_error = HUGE_VAL;

  double backward_error() const { return taken == LossKind::viscous ? viscous_error : complex_error; }
};

using Group = std::vector<CorrectedMode>;

/// The rows of a vector that a larger space has too.
void widen(VectorXcd& a, Index columns)
{
  const Index known = a.size();
  a.conservativeResize(columns);
  a.tail(columns - known).setZero();
}

/// Solves both problems of each mode on the subspace; residuals that are not small join it, until none is left. What is
/// exact stays so, since the subspace only grows.
void solve_group(ComplexSubspace& space, Group& group, const PencilFactor& P)
{
  for (int pass = 0;; ++pass)
  {
    MultiVector residuals{space.V.comm, MatrixXd(space.V.entries.rows(), 0)};
    const auto improve = [&](LossKind kind, DenseEigenpair& pair, double& error)
    {
      widen(pair.y, space.V.columns());
      if (error <= tolerance) return;
      const bool found = solve_lossy(space.entries, kind, pair);
      const MultiVector residual = residual_of(space, loss_factors(kind, pair.lambda), pair.y, error);
      if (found && error > tolerance) append(residuals, residual);
      if (!found) error = HUGE_VAL;
    };
    for (CorrectedMode& mode : group)
    {
      improve(LossKind::complex, mode.complex, mode.complex_error);
      if (mode.taken == LossKind::complex) continue;
      improve(LossKind::viscous, mode.viscous, mode.viscous_error);
      if (!std::isfinite(mode.viscous_error) || !is_equivalent(mode.viscous, mode.complex))
        mode.taken = LossKind::complex;
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

/// Pairs with their losses.
struct LossyPairs
{
  std::vector<Eigenpair> pairs{};
  std::vector<ModeLoss> losses{};
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
  result.losses.resize(eigenvalues.size());
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
    const std::vector<LossyMode> with = with_losses(space.entries, without);
    Group group;
    for (std::size_t k = first; k < end; ++k) group.push_back({with[k]});
    const double middle = eigenvalues[places[(first + end - 1) / 2]].imag();
    move_to(pencil, 1.0001 * middle * middle);
    solve_group(space, group, *pencil.factor);
    for (std::size_t k = first; k < end; ++k)
    {
      Eigenpair& pair = result.pairs[places[k]];
      const CorrectedMode& mode = group[k - first];
      const DenseEigenpair& own = mode.pair();
      const MultiVector y = vector_of(space, own.y);
      copy_column(y, 0, pair.real);
      copy_column(y, 1, pair.imaginary);
      pair.lambda = own.lambda;
      pair.backward_error = mode.backward_error();
      const double error = std::abs(own.lambda - mode.complex.lambda) / std::abs(own.lambda);
      result.losses[places[k]] = {loss_factor_of(mode.taken, own.lambda),
                                  mode.taken == LossKind::viscous ? error : std::numeric_limits<double>::quiet_NaN()};
    }
  }
  return result;
}

} // namespace

std::vector<ModeLoss> correct_loss(QuadraticSolution& solution, const QuadraticProblem& problem, Mat K_loss,
                                   const PencilOptions& options)
{
  const ComplexSubspace empty = empty_subspace({problem.M, problem.C, problem.K, K_loss});
  ShiftInvert pencil = make_shift_invert(problem.K, problem.M, Symmetry::none, options);
  LossyPairs found;
  std::optional<Complex> twice;
  for (const std::size_t in_group : {usual_group, largest_group})
  {
    found = solve_in_groups(solution.pairs, empty, pencil, in_group);
    twice = doubled(found.pairs, problem.K);
    if (!twice) break;
  }
  solution.pairs = std::move(found.pairs);
  if (twice && solution.outcome.kind == OutcomeKind::converged)
  {
    solution.outcome.kind = OutcomeKind::not_converged;
    solution.outcome.reason = describe_doubled(*twice);
  }
  solution.outcome.residual = 0;
  for (const Eigenpair& pair : solution.pairs)
    solution.outcome.residual = std::max(solution.outcome.residual, pair.backward_error);
  return std::move(found.losses);
}

} // namespace squeal
