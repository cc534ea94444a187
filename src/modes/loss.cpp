#include "loss.hpp"

#include "complex_subspace.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/two_sided.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

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

/// A mode with the backward error of the pair taken.
struct CorrectedMode : LossyMode
{
  double backward_error = 0;
};

using Group = std::vector<CorrectedMode>;

/// The rows of a vector that a larger space has too.
void widen(VectorXcd& a, Index columns)
{
  const Index known = a.size();
  a.conservativeResize(columns);
  a.tail(columns - known).setZero();
}

/// Solves both problems of each mode on the subspace; residuals that are not small join it, until none is left.
void solve_group(ComplexSubspace& space, Group& group, const PencilFactor& P)
{
  for (int pass = 0;; ++pass)
  {
    MultiVector residuals{space.V.comm, MatrixXd(space.V.entries.rows(), 0)};
    const auto improve = [&](LossKind kind, DenseEigenpair& pair)
    {
      widen(pair.y, space.V.columns());
      const bool found = solve_lossy(space.entries, kind, pair);
      double error = 0;
      const MultiVector residual = residual_of(space, loss_factors(kind, pair.lambda), pair.y, error);
      if (found && error > tolerance) append(residuals, residual);
      return found ? error : HUGE_VAL;
    };
    for (CorrectedMode& mode : group)
    {
      mode.backward_error = improve(LossKind::complex, mode.complex);
      if (mode.taken == LossKind::complex) continue;
      const double error = improve(LossKind::viscous, mode.viscous);
      if (std::isfinite(error) && is_equivalent(mode.viscous, mode.complex))
        mode.backward_error = error;
      else
        mode.taken = LossKind::complex;
    }
    if (residuals.columns() == 0 || pass == passes) return;
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

/// A pair that stands twice; null: none. Collective.
const Eigenpair* doubled(const std::vector<Eigenpair>& pairs, Mat A)
{
  for (std::size_t k = 1; k < pairs.size(); ++k)
    for (std::size_t l = 0; l < k; ++l)
      if (are_one(pairs[l], pairs[k], A)) return &pairs[k];
  return nullptr;
}

} // namespace

std::vector<ModeLoss> correct_loss(QuadraticSolution& solution, const QuadraticProblem& problem, Mat K_loss,
                                   const PencilOptions& options)
{
  const ComplexSubspace empty = empty_subspace({problem.M, problem.C, problem.K, K_loss});
  std::vector<ModeLoss> losses(solution.pairs.size());
  std::vector<Complex> eigenvalues;
  for (const Eigenpair& pair : solution.pairs) eigenvalues.push_back(pair.lambda);
  ShiftInvert pencil = make_shift_invert(problem.K, problem.M, Symmetry::none, options);
  for (const auto& [places, first, end] : neighbouring_pairs(eigenvalues))
  {
    ComplexSubspace space = empty;
    MultiVector shapes = empty.V;
    for (const std::size_t place : places)
      for (const Vec part : {solution.pairs[place].real.get(), solution.pairs[place].imaginary.get()})
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
      Eigenpair& pair = solution.pairs[places[k]];
      const CorrectedMode& mode = group[k - first];
      const DenseEigenpair& own = mode.pair();
      const MultiVector y = vector_of(space, own.y);
      copy_column(y, 0, pair.real);
      copy_column(y, 1, pair.imaginary);
      pair.lambda = own.lambda;
      pair.backward_error = mode.backward_error;
      const double error = std::abs(own.lambda - mode.complex.lambda) / std::abs(own.lambda);
      losses[places[k]] = {loss_factor_of(mode.taken, own.lambda),
                           mode.taken == LossKind::viscous ? error : std::numeric_limits<double>::quiet_NaN()};
    }
  }
  if (const Eigenpair* pair = doubled(solution.pairs, problem.K);
      pair && solution.outcome.kind == OutcomeKind::converged)
  {
    solution.outcome.kind = OutcomeKind::not_converged;
    solution.outcome.reason = describe_doubled(pair->lambda);
  }
  solution.outcome.residual = 0;
  for (const Eigenpair& pair : solution.pairs)
    solution.outcome.residual = std::max(solution.outcome.residual, pair.backward_error);
  return losses;
}

} // namespace squeal
