#include "loss.hpp"

#include "squeal/algebra/shift_invert.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/LU>
#include <numeric>

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
constexpr int passes = 12;            // of residual correction, at most
constexpr double tolerance = 1e-13;   // backward error
constexpr int newton_steps = 60;      // each divides the error of omega by about 2/eta^2

/// The matrices of a problem on a subspace V, with their products A V: M, C_0, K, K_loss.
struct Projected
{
  std::array<Mat, 4> matrices{};
  std::array<double, 4> norms{};
  MultiVector V;
  std::array<MultiVector, 4> images{};
  std::array<MatrixXd, 4> entries{};
};

enum class Stiffness
{
  viscous, // K + lambda K_loss/omega
  complex, // K + i K_loss
};

/// Factors of M, C_0, K and K_loss in the problem at lambda.
std::array<Complex, 4> factors(Stiffness stiffness, Complex lambda)
{
  const Complex loss = stiffness == Stiffness::viscous ? lambda / lambda.imag() : Complex(0, 1);
  return {lambda * lambda, lambda, 1, loss};
}

/// Their derivatives in lambda, at a constant omega.
std::array<Complex, 4> derivatives(Stiffness stiffness, Complex lambda)
{
  return {2. * lambda, 1, 0, stiffness == Stiffness::viscous ? 1 / lambda.imag() : 0};
}

Eigen::MatrixXcd sum(const std::array<MatrixXd, 4>& A, const std::array<Complex, 4>& factor)
{
  Eigen::MatrixXcd result = factor[0] * A[0];
  for (std::size_t k = 1; k < 4; ++k) result += factor[k] * A[k];
  return result;
}

/// V gains what X adds to its span. Returns whether that is anything.
bool extend(Projected& space, MultiVector X)
{
  const Index gained = extend_orthonormal(space.V, std::move(X));
  if (gained == 0) return false;
  const MultiVector W = columns_from(space.V, space.V.columns() - gained);
  for (std::size_t k = 0; k < 4; ++k)
  {
    append(space.images[k], product(space.matrices[k], W));
    space.entries[k] = inner_products(space.V, space.images[k]);
  }
  return true;
}

/// A pair on the subspace.
struct SmallPair
{
  Complex lambda;
  VectorXcd a;
};

/// Newton's method on (lambda, a), with omega taken from the last lambda.
void solve_small(const Projected& space, Stiffness stiffness, SmallPair& pair)
{
  for (int step = 0; step < newton_steps; ++step)
  {
    const Eigen::PartialPivLU<Eigen::MatrixXcd> T(sum(space.entries, factors(stiffness, pair.lambda)));
    const VectorXcd x = T.solve(sum(space.entries, derivatives(stiffness, pair.lambda)) * pair.a);
    if (!x.allFinite()) return; // T is singular: lambda is an eigenvalue to rounding
    const Complex along = pair.a.dot(x);
    const Complex change = pair.a.squaredNorm() / along;
    pair.a = x.normalized();
    pair.lambda -= change;
    if (std::abs(change) <= 1e-15 * std::abs(pair.lambda)) return;
  }
}

/// The residual of a pair in the whole problem, its real and imaginary part, over the sizes of its terms.
MultiVector residual_of(const Projected& space, Stiffness stiffness, const SmallPair& pair, double& backward_error)
{
  const std::array<Complex, 4> factor = factors(stiffness, pair.lambda);
  MultiVector result{space.V.comm, MatrixXd::Zero(space.V.entries.rows(), 2)};
  double scale = 0;
  for (std::size_t k = 0; k < 4; ++k)
  {
    const VectorXcd a = factor[k] * pair.a;
    MatrixXd parts(a.size(), 2);
    parts << a.real(), a.imag();
    result.entries.noalias() += space.images[k].entries * parts;
    scale += std::abs(factor[k]) * space.norms[k];
  }
  result.entries /= scale; // |a| = 1, and V is orthonormal
  backward_error = column_norms(result).norm();
  return result;
}

/// One group: pairs as they are in, pairs of their own frequency out.
struct Group
{
  std::vector<SmallPair> viscous, complex;
  std::vector<double> backward_errors;
};

/// Solves both problems of each pair on the subspace; residuals that are not small join it, until none is left.
void solve_group(Projected& space, Group& group, const PencilFactor& P)
{
  for (int pass = 0;; ++pass)
  {
    MultiVector residuals{space.V.comm, MatrixXd(space.V.entries.rows(), 0)};
    for (std::size_t i = 0; i < group.viscous.size(); ++i)
      for (const Stiffness stiffness : {Stiffness::viscous, Stiffness::complex})
      {
        SmallPair& pair = (stiffness == Stiffness::viscous ? group.viscous : group.complex)[i];
        VectorXcd a = VectorXcd::Zero(space.V.columns());
        a.head(pair.a.size()) = pair.a;
        pair.a = a;
        solve_small(space, stiffness, pair);
        double error = 0;
        const MultiVector residual = residual_of(space, stiffness, pair, error);
        if (stiffness == Stiffness::viscous) group.backward_errors[i] = error;
        if (error > tolerance) append(residuals, residual);
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
    if (pairs[i].lambda.imag() > 0) order.push_back(i);
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return pairs[a].lambda.imag() < pairs[b].lambda.imag(); });
  return order;
}

double one_norm(Mat A)
{
  double norm = 0;
  check(MatNorm(A, NORM_1, &norm));
  return norm;
}

} // namespace

std::vector<double> correct_loss(QuadraticSolution& solution, const QuadraticProblem& problem, Mat K_loss,
                                 const PencilOptions& options)
{
  const std::array<Mat, 4> matrices = {problem.M, problem.C, problem.K, K_loss};
  std::array<double, 4> norms{};
  std::transform(matrices.begin(), matrices.end(), norms.begin(), one_norm);
  std::vector<double> errors(solution.pairs.size(), 0.);
  const std::vector<std::size_t> order = by_frequency(solution.pairs);
  ShiftInvert pencil = make_shift_invert(problem.K, problem.M, Symmetry::none, options);
  for (std::size_t first = 0; first < order.size(); first += in_group)
  {
    const std::size_t end = std::min(first + in_group, order.size());
    const std::size_t from = first < neighbours ? 0 : first - neighbours, to = std::min(end + neighbours, order.size());
    const MultiVector none = empty_multivector(problem.K);
    Projected space{matrices, norms, none, {none, none, none, none}, {}};
    MultiVector shapes = none;
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
      group.viscous.push_back({solution.pairs[order[k]].lambda, y.normalized()});
    }
    group.complex = group.viscous;
    group.backward_errors.resize(group.viscous.size());
    const double middle = solution.pairs[order[(first + end - 1) / 2]].lambda.imag();
    move_to(pencil, 1.0001 * middle * middle);
    solve_group(space, group, *pencil.factor);
    for (std::size_t k = first; k < end; ++k)
    {
      Eigenpair& pair = solution.pairs[order[k]];
      const SmallPair& own = group.viscous[k - first];
      MatrixXd parts(own.a.size(), 2);
      parts << own.a.real(), own.a.imag();
      const MultiVector y = combination(space.V, parts);
      copy_column(y, 0, pair.real);
      copy_column(y, 1, pair.imaginary);
      pair.lambda = own.lambda;
      pair.backward_error = group.backward_errors[k - first];
      errors[order[k]] = std::abs(own.lambda - group.complex[k - first].lambda) / std::abs(own.lambda);
    }
  }
  solution.outcome.residual = 0;
  for (const Eigenpair& pair : solution.pairs)
    solution.outcome.residual = std::max(solution.outcome.residual, pair.backward_error);
  return errors;
}

} // namespace squeal
