#include "loss.hpp"

#include "complex_subspace.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/two_sided.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/LU>
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

constexpr std::size_t in_group = 16;  // pairs of neighbouring frequency, of which those at the ends are neighbours only
constexpr std::size_t neighbours = 3; // at each end
constexpr int passes = 30;            // of residual correction, at most: losses of 2 and more take over 12
constexpr double tolerance = 1e-13;   // backward error
constexpr int newton_steps = 60;      // each divides the error of omega by about 2/eta^2
constexpr double settled = 1e-12;     // last change of lambda over |lambda|: beyond, there is no fixed point

constexpr double oscillating = 1e-6; // Im(lambda) over |lambda|: below it is the rounding of two real ones

/// Derivatives of the factors in lambda, at a constant omega.
ComplexFactors derivatives(LossKind kind, Complex lambda)
{
  return {2. * lambda, 1, 0, kind == LossKind::viscous ? 1 / lambda.imag() : 0};
}

/// A pair on the subspace.
struct SmallPair
{
  Complex lambda;
  VectorXcd a;
};

/// Newton's method on (lambda, a) with a share of K_loss, and with omega taken from the last lambda. Returns whether it
/// found a pair that oscillates.
bool solve_small(const ComplexSubspace& space, LossKind kind, double share, SmallPair& pair)
{
  double last = HUGE_VAL;
  for (int step = 0; step < newton_steps && last > 1e-15; ++step)
  {
    if (!(pair.lambda.imag() > settled * std::abs(pair.lambda))) return false;
    ComplexFactors factor = loss_factors(kind, pair.lambda), slope = derivatives(kind, pair.lambda);
    factor[3] *= share;
    slope[3] *= share;
    const VectorXcd x =
        Eigen::PartialPivLU<Eigen::MatrixXcd>(sum(space.entries, factor)).solve(sum(space.entries, slope) * pair.a);
    if (!x.allFinite()) return true; // singular: lambda is an eigenvalue to rounding
    const Complex change = pair.a.squaredNorm() / pair.a.dot(x);
    const double now = std::abs(change) / std::abs(pair.lambda);
    if (last <= settled && now > last) return true; // beside a multiple eigenvalue x is rounding
    pair.a = x.normalized();
    pair.lambda -= change;
    last = now;
  }
  return last <= settled && pair.lambda.imag() > settled * std::abs(pair.lambda);
}

/// The pair of all losses that a pair without them becomes as they grow; nothing where it ends on the way. The steps
/// move lambda by about an eighth of its imaginary part.
std::optional<SmallPair> grown(const ComplexSubspace& space, LossKind kind, SmallPair pair)
{
  const auto form = [&](const MatrixXd& A) { return std::abs(pair.a.dot(A * pair.a)); };
  const double loss = form(space.entries[3]) / form(space.entries[2]);
  const int steps = 1 + static_cast<int>(std::min(8 * loss * std::abs(pair.lambda) / pair.lambda.imag(), 40.));
  for (int step = 1; step <= steps; ++step)
    if (!solve_small(space, kind, static_cast<double>(step) / steps, pair)) return std::nullopt;
  return pair;
}

/// A mode: as it is without loss factors in, of its own frequency and of the complex problem out.
struct LossyPair
{
  SmallPair viscous, complex;
  LossKind taken = LossKind::viscous; // complex where there is no fixed point
  double backward_error = 0;          // of the pair taken

  const SmallPair& pair() const { return taken == LossKind::viscous ? viscous : complex; }
};

using Group = std::vector<LossyPair>;

/// The rows of a vector that a larger space has too.
void widen(VectorXcd& a, Index columns)
{
  const Index known = a.size();
  a.conservativeResize(columns);
  a.tail(columns - known).setZero();
}

/// Whether a fixed point belongs to the mode: of one loss factor everywhere its distance is at most 0.466, at eta = 1.
bool is_equivalent(const SmallPair& viscous, const SmallPair& complex)
{
  return std::abs(viscous.lambda - complex.lambda) < 0.5 * std::abs(viscous.lambda);
}

/// Both problems' pairs of each mode on the first subspace.
void start(const ComplexSubspace& space, Group& group)
{
  for (LossyPair& mode : group)
  {
    const std::optional<SmallPair> viscous = grown(space, LossKind::viscous, mode.viscous);
    mode.complex = grown(space, LossKind::complex, mode.complex).value_or(mode.complex);
    mode.taken = viscous && is_equivalent(*viscous, mode.complex) ? LossKind::viscous : LossKind::complex;
    if (viscous) mode.viscous = *viscous;
  }
}

/// Solves both problems of each mode on the subspace; residuals that are not small join it, until none is left.
void solve_group(ComplexSubspace& space, Group& group, const PencilFactor& P)
{
  start(space, group);
  for (int pass = 0;; ++pass)
  {
    MultiVector residuals{space.V.comm, MatrixXd(space.V.entries.rows(), 0)};
    const auto improve = [&](LossKind kind, SmallPair& pair)
    {
      widen(pair.a, space.V.columns());
      const bool found = solve_small(space, kind, 1, pair);
      double error = 0;
      const MultiVector residual = residual_of(space, loss_factors(kind, pair.lambda), pair.a, error);
      if (found && error > tolerance) append(residuals, residual);
      return found ? error : HUGE_VAL;
    };
    for (LossyPair& mode : group)
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

/// The places of the pairs that oscillate, by frequency.
std::vector<std::size_t> by_frequency(const std::vector<Eigenpair>& pairs)
{
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (pairs[i].lambda.imag() > oscillating * std::abs(pairs[i].lambda)) order.push_back(i);
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return pairs[a].lambda.imag() < pairs[b].lambda.imag(); });
  return order;
}

} // namespace

std::vector<ModeLoss> correct_loss(QuadraticSolution& solution, const QuadraticProblem& problem, Mat K_loss,
                                   const PencilOptions& options)
{
  const ComplexSubspace empty = empty_subspace({problem.M, problem.C, problem.K, K_loss});
  std::vector<ModeLoss> losses(solution.pairs.size());
  const std::vector<std::size_t> order = by_frequency(solution.pairs);
  ShiftInvert pencil = make_shift_invert(problem.K, problem.M, Symmetry::none, options);
  for (std::size_t first = 0; first < order.size(); first += in_group)
  {
    const std::size_t end = std::min(first + in_group, order.size());
    const std::size_t from = first < neighbours ? 0 : first - neighbours, to = std::min(end + neighbours, order.size());
    ComplexSubspace space = empty;
    MultiVector shapes = empty.V;
    for (std::size_t k = from; k < to; ++k)
      for (const Vec part : {solution.pairs[order[k]].real.get(), solution.pairs[order[k]].imaginary.get()})
        append(shapes, part);
    extend(space, shapes);
    const MatrixXd a = inner_products(space.V, shapes);
    Group group;
    for (std::size_t k = first; k < end; ++k)
    {
      const auto column = static_cast<Index>(2 * (k - from));
      const VectorXcd y = a.col(column).cast<Complex>() + Complex(0, 1) * a.col(column + 1);
      const SmallPair found{solution.pairs[order[k]].lambda, y.normalized()};
      group.push_back({found, found});
    }
    const double middle = solution.pairs[order[(first + end - 1) / 2]].lambda.imag();
    move_to(pencil, 1.0001 * middle * middle);
    solve_group(space, group, *pencil.factor);
    for (std::size_t k = first; k < end; ++k)
    {
      Eigenpair& pair = solution.pairs[order[k]];
      const LossyPair& mode = group[k - first];
      const SmallPair& own = mode.pair();
      const MultiVector y = vector_of(space, own.a);
      copy_column(y, 0, pair.real);
      copy_column(y, 1, pair.imaginary);
      pair.lambda = own.lambda;
      pair.backward_error = mode.backward_error;
      const double error = std::abs(own.lambda - mode.complex.lambda) / std::abs(own.lambda);
      losses[order[k]] = {loss_factor_of(mode.taken, own.lambda),
                          mode.taken == LossKind::viscous ? error : std::numeric_limits<double>::quiet_NaN()};
    }
  }
  solution.outcome.residual = 0;
  for (const Eigenpair& pair : solution.pairs)
    solution.outcome.residual = std::max(solution.outcome.residual, pair.backward_error);
  return losses;
}

} // namespace squeal
