#include "squeal/modes/dense_losses.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

constexpr std::size_t in_group = 16;  // pairs of neighbouring frequency, of which those at the ends are neighbours only
constexpr std::size_t neighbours = 3; // at each end
constexpr int newton_steps = 60;      // each divides the error of omega by about 2/eta^2
constexpr double settled = 1e-12;     // last change of lambda over |lambda|: beyond, there is no fixed point
constexpr double oscillating = 1e-6;  // Im(lambda) over |lambda|: below it is the rounding of two real ones

} // namespace

Complex loss_factor_of(LossKind kind, Complex lambda)
{
  switch (kind)
  {
  case LossKind::none:
    return 0;
  case LossKind::viscous:
    return lambda / lambda.imag();
  case LossKind::complex:
    return {0, 1};
  }
  return 0;
}

EigenvalueSlope slope_of(LossKind kind, Complex lambda, Complex mass, Complex damping, Complex loss)
{
  EigenvalueSlope result{2. * lambda * mass + damping, 0};
  if (kind != LossKind::viscous) return result;
  const double omega = lambda.imag();
  result.slope += loss / omega;
  result.turn = -lambda / (omega * omega) * loss;
  return result;
}

Complex eigenvalue_change(const EigenvalueSlope& slope, Complex residual)
{
  const Complex of_imaginary = Complex(0, 1) * slope.slope + slope.turn; // the equation is real-linear in d lambda
  Eigen::Matrix2d A;
  A << slope.slope.real(), of_imaginary.real(), slope.slope.imag(), of_imaginary.imag();
  const Eigen::Vector2d change = -(A.inverse() * Eigen::Vector2d(residual.real(), residual.imag()));
  return {change(0), change(1)};
}

ComplexFactors loss_factors(LossKind kind, Complex lambda)
{
  return {lambda * lambda, lambda, 1, loss_factor_of(kind, lambda)};
}

MatrixXcd sum(const LossyMatrices& A, const ComplexFactors& factors)
{
  MatrixXcd result = factors[0] * A[0];
  for (std::size_t k = 1; k < 4; ++k) result += factors[k] * A[k];
  return result;
}

namespace
{

/// Derivatives of the factors in lambda, at a constant omega.
ComplexFactors derivatives(LossKind kind, Complex lambda)
{
  return {2. * lambda, 1, 0, kind == LossKind::viscous ? 1 / lambda.imag() : 0};
}

/// Newton's method on (lambda, y) with a share of K_loss, and with omega taken from the last lambda. Returns whether it
/// found a pair that oscillates.
bool solve_with_share(const LossyMatrices& problem, LossKind kind, double share, DenseEigenpair& pair)
{
  double last = HUGE_VAL;
  for (int step = 0; step < newton_steps && last > 1e-15; ++step)
  {
    if (!(pair.lambda.imag() > settled * std::abs(pair.lambda))) return false;
    ComplexFactors factor = loss_factors(kind, pair.lambda), slope = derivatives(kind, pair.lambda);
    factor[3] *= share;
    slope[3] *= share;
    const VectorXcd x = Eigen::PartialPivLU<MatrixXcd>(sum(problem, factor)).solve(sum(problem, slope) * pair.y);
    if (!x.allFinite()) return true; // singular: lambda is an eigenvalue to rounding
    const Complex change = pair.y.squaredNorm() / pair.y.dot(x);
    const double now = std::abs(change) / std::abs(pair.lambda);
    if (last <= settled && now > last) return true; // beside a multiple eigenvalue x is rounding
    pair.y = x.normalized();
    pair.lambda -= change;
    last = now;
  }
  return last <= settled && pair.lambda.imag() > settled * std::abs(pair.lambda);
}

/// The pair of all losses that a pair without them becomes as they grow; nothing where it ends on the way. The steps
/// move lambda by about an eighth of its imaginary part, or a `finer` part of that.
std::optional<DenseEigenpair> grown(const LossyMatrices& problem, LossKind kind, DenseEigenpair pair, int finer)
{
  const auto form = [&](const MatrixXd& A) { return std::abs(pair.y.dot(A * pair.y)); };
  const double loss = form(problem[3]) / form(problem[2]);
  const int steps =
      finer * (1 + static_cast<int>(std::min(8 * loss * std::abs(pair.lambda) / pair.lambda.imag(), 40.)));
  for (int step = 1; step <= steps; ++step)
    if (!solve_with_share(problem, kind, static_cast<double>(step) / steps, pair)) return std::nullopt;
  return pair;
}

} // namespace

bool solve_lossy(const LossyMatrices& problem, LossKind kind, DenseEigenpair& pair)
{
  return solve_with_share(problem, kind, 1, pair);
}

bool is_equivalent(const DenseEigenpair& viscous, const DenseEigenpair& complex)
{
  return std::abs(viscous.lambda - complex.lambda) < 0.5 * std::abs(viscous.lambda);
}

LossyMode with_losses(const LossyMatrices& problem, const DenseEigenpair& without, int finer)
{
  const std::optional<DenseEigenpair> viscous = grown(problem, LossKind::viscous, without, finer);
  LossyMode mode{viscous.value_or(without), grown(problem, LossKind::complex, without, finer).value_or(without)};
  if (!viscous || !is_equivalent(*viscous, mode.complex)) mode.taken = LossKind::complex;
  return mode;
}

std::vector<NeighbouringPairs> neighbouring_pairs(const std::vector<Complex>& eigenvalues)
{
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < eigenvalues.size(); ++i)
    if (eigenvalues[i].imag() > oscillating * std::abs(eigenvalues[i])) order.push_back(i);
  std::ranges::sort(order, {}, [&](std::size_t i) { return eigenvalues[i].imag(); });
  std::vector<NeighbouringPairs> groups;
  for (std::size_t first = 0; first < order.size(); first += in_group)
  {
    const std::size_t end = std::min(first + in_group, order.size());
    const std::size_t from = first < neighbours ? 0 : first - neighbours, to = std::min(end + neighbours, order.size());
    groups.push_back(
        {{order.begin() + static_cast<std::ptrdiff_t>(from), order.begin() + static_cast<std::ptrdiff_t>(to)},
         first - from,
         end - from});
  }
  return groups;
}

namespace
{

/// Newton's method from the pair's right vector, then inverse iteration for the left one of the same lambda, which is
/// that of the two-sided Rayleigh quotient in the end. Beside lock-in inverse iteration of both sides at once may lead
/// them to two modes, which share nothing: the quotient is of any size then.
void refine(const LossyMatrices& problem, TwoSidedPair& pair)
{
  constexpr double beside = 1e-13; // of lambda, so that no pivot vanishes
  DenseEigenpair right{pair.lambda, pair.right};
  if (solve_lossy(problem, pair.loss, right))
  {
    pair.lambda = right.lambda;
    pair.right = right.y;
  }
  const Eigen::PartialPivLU<MatrixXcd> factor(sum(problem, loss_factors(pair.loss, pair.lambda * (1 + beside))));
  for (int iteration = 0; iteration < 2; ++iteration)
  {
    pair.right = factor.solve(pair.right).normalized();
    pair.left = factor.transpose().solve(pair.left).normalized();
  }
  const ComplexFactors factors = loss_factors(pair.loss, pair.lambda);
  std::array<Complex, 4> products{};
  Complex residual = 0;
  for (std::size_t k = 0; k < 4; ++k)
  {
    products[k] = pair.left.transpose() * (problem[k] * pair.right);
    residual += factors[k] * products[k];
  }
  pair.lambda += eigenvalue_change(slope_of(pair.loss, pair.lambda, products[0], products[1], products[3]), residual);
}

/// Real and imaginary parts of vectors of one side.
MatrixXd parts_of(const std::vector<TwoSidedPair>& pairs, const std::vector<std::size_t>& places,
                  VectorXcd TwoSidedPair::*side)
{
  MatrixXd parts((pairs[places.front()].*side).size(), 2 * static_cast<Index>(places.size()));
  for (Index column = 0; const std::size_t place : places)
  {
    parts.col(column++) = (pairs[place].*side).real();
    parts.col(column++) = (pairs[place].*side).imag();
  }
  return parts;
}

/// The problem on the span of a few pairs, M being 1. It is tested by the left vectors: those of the matrices may have
/// any other basis.
struct OnSpan
{
  MatrixXd V;           // of right vectors
  MatrixXd coordinates; // of x: times M x
  LossyMatrices problem;
};

/// Directions of both sides go together by the singular vectors of M between them. What either side has by itself, as
/// where real and imaginary parts are nearly parallel, would leave M singular.
OnSpan on_span(const LossyMatrices& problem, const std::vector<TwoSidedPair>& pairs,
               const std::vector<std::size_t>& places)
{
  constexpr double independent = 1e-6; // of a start
  const MatrixXd R = parts_of(pairs, places, &TwoSidedPair::right), L = parts_of(pairs, places, &TwoSidedPair::left);
  Eigen::JacobiSVD<MatrixXd> svd(L.transpose() * problem[0] * R, Eigen::ComputeThinU | Eigen::ComputeThinV);
  svd.setThreshold(independent);
  const Index rank = svd.rank();
  OnSpan result{R * svd.matrixV().leftCols(rank), {}, {}};
  result.coordinates =
      svd.singularValues().head(rank).cwiseInverse().asDiagonal() * (L * svd.matrixU().leftCols(rank)).transpose();
  for (std::size_t k = 0; k < 4; ++k) result.problem[k] = result.coordinates * problem[k] * result.V;
  return result;
}

/// Whether Newton's method led two pairs to one.
bool are_one(const TwoSidedPair& a, const TwoSidedPair& b)
{
  constexpr double same = 1e-8; // of two defective pairs lambdas and vectors are as far apart as rounding's root
  const double apart = (a.right - b.right.dot(a.right) * b.right).norm();
  return std::abs(a.lambda - b.lambda) < same * std::abs(a.lambda) && apart < 0.1 * same;
}

/// What a pair without losses becomes with them on these matrices, followed all the way.
void follow_losses(const LossyMatrices& problem, TwoSidedPair& pair, int finer = 1)
{
  const LossyMode mode = with_losses(problem, {pair.lambda, pair.right}, finer);
  pair.lambda = mode.pair().lambda;
  pair.right = mode.pair().y;
  pair.loss = mode.taken;
}

void add_losses(const LossyMatrices& problem, std::vector<TwoSidedPair>& pairs)
{
  std::vector<Complex> eigenvalues;
  for (const TwoSidedPair& pair : pairs) eigenvalues.push_back(pair.lambda);
  const std::vector<TwoSidedPair> without = pairs;
  std::vector<std::size_t> solved;
  for (const NeighbouringPairs& group : neighbouring_pairs(eigenvalues))
  {
    const auto [V, coordinates, small] = on_span(problem, without, group.places);
    for (std::size_t k = group.first; k < group.end; ++k)
    {
      TwoSidedPair& pair = pairs[group.places[k]];
      pair.right = (coordinates * (problem[0] * pair.right)).normalized();
      follow_losses(small, pair);
      pair.right = (V * pair.right).normalized();
      refine(problem, pair);
      solved.push_back(group.places[k]);
    }
  }
  std::vector<char> again(pairs.size(), 0);
  for (std::size_t k = 1; k < solved.size(); ++k)
    for (std::size_t l = 0; l < k; ++l)
      if (are_one(pairs[solved[l]], pairs[solved[k]])) again[solved[l]] = again[solved[k]] = 1;
  for (const std::size_t place : solved)
  {
    constexpr int finer = 16; // near lock-in one step goes over to the other mode
    if (!again[place]) continue;
    pairs[place] = without[place];
    follow_losses(problem, pairs[place], finer);
    refine(problem, pairs[place]);
  }
}

} // namespace

void add_losses_shared(MPI_Comm comm, const LossyMatrices& problem, std::vector<TwoSidedPair>& pairs)
{
  on_rank_zero(comm, [&] { add_losses(problem, pairs); });
  share(comm, pairs, problem[2].rows());
}

void refine_lossy_shared(MPI_Comm comm, const LossyMatrices& problem, std::vector<TwoSidedPair>& pairs)
{
  on_rank_zero(comm,
               [&]
               {
                 for (TwoSidedPair& pair : pairs) refine(problem, pair);
               });
  share(comm, pairs, problem[2].rows());
}

} // namespace squeal
