#include "squeal/modes/dense_losses.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/algebra/multivector.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <numeric>
#include <span>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr std::size_t neighbours = 3; // of a group, at each end
constexpr int newton_steps = 60;
constexpr double settled = 1e-12;    // last change of lambda over |lambda|
constexpr double sensitive = 1e-9;   // the same of a lambda that rounding keeps from settling, by its condition
constexpr double rounding = 1e-15;   // of lambda
constexpr double beside = 1e-13;     // of lambda: where no pivot vanishes
constexpr double oscillating = 1e-6; // Im(lambda) over |lambda|: below it is the rounding of two real ones

} // namespace

Complex loss_factor_of(Complex lambda)
{
  return {0, lambda.imag() > 0 ? 1. : 0.};
}

ComplexFactors loss_factors(Complex lambda)
{
  return {lambda * lambda, lambda, 1, loss_factor_of(lambda)};
}

MatrixXcd sum(const LossyMatrices& A, const ComplexFactors& factors)
{
  MatrixXcd result = factors[0] * A[0];
  for (std::size_t k = 1; k < 4; ++k) result += factors[k] * A[k];
  return result;
}

namespace
{

/// The problem with a share of i K_loss.
MatrixXcd with_share(const LossyMatrices& A, double share, Complex lambda)
{
  return sum(A, {lambda * lambda, lambda, 1, Complex(0, share)});
}

/// Its derivative in lambda.
MatrixXcd derivative(const LossyMatrices& A, Complex lambda)
{
  return 2. * lambda * A[0] + A[1];
}

/// Newton's method on (lambda, y). Returns whether it found a pair that oscillates.
bool solve_at(const LossyMatrices& problem, double share, Complex& lambda, VectorXcd& y)
{
  const auto oscillates = [&] { return lambda.imag() > settled * std::abs(lambda); };
  double last = HUGE_VAL;
  for (int step = 0; step < newton_steps && last > rounding; ++step)
  {
    if (!oscillates()) return false;
    const VectorXcd x =
        Eigen::PartialPivLU<MatrixXcd>(with_share(problem, share, lambda)).solve(derivative(problem, lambda) * y);
    if (!x.allFinite()) return true; // singular: lambda is an eigenvalue to rounding
    const Complex change = y.squaredNorm() / y.dot(x);
    const double now = std::abs(change) / std::abs(lambda);
    if (last <= settled && now > last) return true; // beside a multiple eigenvalue x is rounding
    y = x.normalized();
    lambda -= change;
    if (now <= settled && now / last * now <= rounding) return oscillates(); // what the next step would change
    last = now;
  }
  return last <= sensitive && oscillates();
}

/// The left vector that belongs to lambda and the right one, by inverse iteration from its conjugate: their product
/// without conjugation, which says how much of the left vector the start has, is 1.
void find_left(const LossyMatrices& problem, double share, TwoSidedPair& pair)
{
  const Eigen::PartialPivLU<MatrixXcd> factor(with_share(problem, share, pair.lambda * (1 + beside)));
  pair.left = pair.right.conjugate();
  for (int iteration = 0; iteration < 2; ++iteration) pair.left = factor.transpose().solve(pair.left).normalized();
}

/// The pairs after a change of the share of their losses, to first order in it: the problem on the states
/// (y, lambda y) of all of them, where near neighbours mix at once while no two become one. Each keeps the place that
/// it has most of.
std::vector<TwoSidedPair> changed_together(const LossyMatrices& problem, const std::vector<TwoSidedPair>& pairs,
                                           double from, double to)
{
  const auto count = static_cast<Index>(pairs.size());
  const MatrixXcd right = vectors_of(pairs, &TwoSidedPair::right), left = vectors_of(pairs, &TwoSidedPair::left);
  MatrixXcd H = left.transpose() * (problem[3] * right);
  const VectorXcd mass = (left.array() * (problem[0] * right).array()).colwise().sum(),
                  damping = (left.array() * (problem[1] * right).array()).colwise().sum();
  for (Index i = 0; i < count; ++i)
  {
    const Complex lambda = pairs[static_cast<std::size_t>(i)].lambda;
    H.row(i) *= Complex(0, from - to) / (2. * lambda * mass(i) + damping(i));
    H(i, i) += lambda;
  }
  if (!H.allFinite()) return pairs;
  const Eigen::ComplexEigenSolver<MatrixXcd> solver(H);
  if (solver.info() != Eigen::Success) return pairs;
  const MatrixXcd mixed = right * solver.eigenvectors();
  Eigen::MatrixXd parts = solver.eigenvectors().cwiseAbs();
  std::vector<TwoSidedPair> changed = pairs;
  for (Index rest = 0; rest < count; ++rest)
  {
    Index place = 0, column = 0;
    parts.maxCoeff(&place, &column);
    TwoSidedPair& pair = changed[static_cast<std::size_t>(place)];
    pair.lambda = solver.eigenvalues()(column);
    pair.right = mixed.col(column).normalized();
    parts.row(place).setConstant(-1);
    parts.col(column).setConstant(-1);
  }
  return changed;
}

/// The same of pairs or of their right vectors.
bool are_one(Complex a, const VectorXcd& of_a, Complex b, const VectorXcd& of_b, const Sameness& limits)
{
  return std::abs(a - b) < limits.lambda * std::abs(a) && (of_a - of_b.dot(of_a) * of_b).norm() < limits.vector;
}

/// The places of pairs that are the same as another one.
std::vector<std::size_t> doubled(const std::vector<TwoSidedPair>& pairs)
{
  std::vector<std::size_t> places;
  for (std::size_t k = 0; k < pairs.size(); ++k)
    for (std::size_t l = 0; l < pairs.size(); ++l)
      if (l != k && are_one(pairs[l].lambda, pairs[l].right, pairs[k].lambda, pairs[k].right, {}))
      {
        places.push_back(k);
        break;
      }
  return places;
}

/// Continuation of pairs together from no losses to all of them, in at least so many steps: in shorter ones where
/// Newton's method fails or leads two pairs to one. Nothing is left of pairs that end on the way.
std::vector<std::optional<TwoSidedPair>> follow(const LossyMatrices& problem, std::vector<TwoSidedPair> pairs,
                                                int steps)
{
  constexpr double shortest = 1. / 64; // of a step: a pair that fails in these has ended
  std::vector<std::optional<TwoSidedPair>> result(pairs.size());
  std::vector<std::size_t> places(pairs.size());
  std::iota(places.begin(), places.end(), 0);
  double at = 0, step = 1. / steps;
  bool apart = true;
  for (TwoSidedPair& pair : pairs) find_left(problem, 0, pair);
  while (at < 1 && !pairs.empty())
  {
    const double next = at + 1.5 * step < 1 ? at + step : 1;
    std::vector<TwoSidedPair> tried = changed_together(problem, pairs, at, next);
    std::vector<char> found;
    for (TwoSidedPair& pair : tried) found.push_back(solve_at(problem, next, pair.lambda, pair.right) ? 1 : 0);
    const bool all_found = std::ranges::count(found, 0) == 0;
    const bool all_apart = !apart || doubled(tried).empty();
    if (step * steps > shortest && !(all_found && all_apart))
    {
      step /= 2;
      continue;
    }
    apart = apart && all_apart; // what is one stays one
    pairs.clear();
    std::vector<std::size_t> kept;
    for (std::size_t k = 0; k < tried.size(); ++k)
      if (found[k])
      {
        if (next < 1) find_left(problem, next, tried[k]);
        pairs.push_back(std::move(tried[k]));
        kept.push_back(places[k]);
      }
    places = std::move(kept);
    at = next;
    step = std::min(2 * step, 1. / steps);
  }
  for (std::size_t k = 0; k < places.size(); ++k) result[places[k]] = std::move(pairs[k]);
  return result;
}

/// Steps that move each lambda by about an eighth of its imaginary part.
int steps_to_losses(const LossyMatrices& problem, const std::vector<DenseEigenpair>& without)
{
  double moves = 0;
  for (const auto& [lambda, y] : without)
  {
    const auto form = [&](const MatrixXd& A) { return std::abs(y.dot(A * y)); };
    moves = std::max(moves, form(problem[3]) / form(problem[2]) * std::abs(lambda) / lambda.imag());
  }
  return 1 + static_cast<int>(std::min(8 * moves, 40.));
}

} // namespace

bool solve_lossy(const LossyMatrices& problem, DenseEigenpair& pair)
{
  return solve_at(problem, 1, pair.lambda, pair.y);
}

bool solve_lossy_beside(const LossyMatrices& problem, std::span<const DenseEigenpair> others, DenseEigenpair& pair)
{
  constexpr int apart = 4; // steps: what is left of the others is of rounding, and their lambdas are not its own
  std::vector<std::pair<VectorXcd, Eigen::RowVectorXcd>> known; // a pair's vector, and what takes its part of another
  for (const DenseEigenpair& other : others)
  {
    TwoSidedPair both{other.lambda, other.y, {}};
    find_left(problem, 1, both);
    const Eigen::RowVectorXcd row = both.left.transpose() * derivative(problem, both.lambda);
    known.emplace_back(other.y, row / (row * other.y)(0));
  }
  const auto without_others = [&](VectorXcd y)
  {
    for (int time = 0; time < 2; ++time) // near pairs are not orthogonal to each other
      for (const auto& [vector, row] : known) y -= (row * y)(0) * vector;
    return VectorXcd(y.normalized());
  };
  for (int step = 0; step < apart && pair.lambda.imag() > settled * std::abs(pair.lambda); ++step)
  {
    pair.y = without_others(pair.y);
    const VectorXcd x = without_others(Eigen::PartialPivLU<MatrixXcd>(with_share(problem, 1, pair.lambda))
                                           .solve(derivative(problem, pair.lambda) * pair.y));
    if (!x.allFinite()) return false;
    pair.y = x;
    const Complex residual = x.dot(with_share(problem, 1, pair.lambda) * x),
                  slope = x.dot(derivative(problem, pair.lambda) * x);
    pair.lambda -= residual / slope;
  }
  return solve_lossy(problem, pair);
}

bool are_one(const DenseEigenpair& a, const DenseEigenpair& b, const Sameness& limits)
{
  return are_one(a.lambda, a.y, b.lambda, b.y, limits);
}

std::optional<Complex> doubled_lambda(const std::vector<TwoSidedPair>& pairs)
{
  for (const std::size_t place : doubled(pairs))
    if (pairs[place].lambda.imag() > 0) return pairs[place].lambda;
  return std::nullopt;
}

std::string describe_doubled(Complex lambda)
{
  return format("loss factors lead two modes to the one of %.6g Hz, so that a mode is missing", lambda.imag() / two_pi);
}

std::vector<DenseEigenpair> with_losses(const LossyMatrices& problem, const std::vector<DenseEigenpair>& without)
{
  std::vector<TwoSidedPair> pairs;
  for (const auto& [lambda, y] : without) pairs.push_back({lambda, y, {}});
  const auto found = follow(problem, std::move(pairs), steps_to_losses(problem, without));
  std::vector<DenseEigenpair> result = without;
  for (std::size_t k = 0; k < result.size(); ++k)
    if (found[k]) result[k] = {found[k]->lambda, found[k]->right};
  return result;
}

std::vector<NeighbouringPairs> neighbouring_pairs(const std::vector<Complex>& eigenvalues, std::size_t in_group)
{
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < eigenvalues.size(); ++i)
    if (eigenvalues[i].imag() > oscillating * std::abs(eigenvalues[i])) order.push_back(i);
  std::ranges::sort(order, {}, [&](std::size_t i) { return eigenvalues[i].imag(); });
  std::vector<NeighbouringPairs> groups;
  for (std::size_t first = 0, end = 0; first < order.size(); first = end)
  {
    end = std::min(first + in_group, order.size());
    if (end < order.size()) // at the widest of the last gaps: near neighbours mix, and stay together
    {
      const auto gap = [&](std::size_t i) { return eigenvalues[order[i]].imag() - eigenvalues[order[i - 1]].imag(); };
      for (std::size_t i = end - 1; i > first + in_group / 2; --i)
        if (gap(i) > gap(end)) end = i;
    }
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

/// Moves lambda by the two-sided Rayleigh quotient.
void take_quotient(const LossyMatrices& problem, TwoSidedPair& pair)
{
  const ComplexFactors factors = loss_factors(pair.lambda);
  std::array<Complex, 4> products{};
  Complex residual = 0;
  for (std::size_t k = 0; k < 4; ++k)
  {
    products[k] = pair.left.transpose() * (problem[k] * pair.right);
    residual += factors[k] * products[k];
  }
  pair.lambda -= residual / (2. * pair.lambda * products[0] + products[1]);
}

/// Newton's method from the pair's right vector, then inverse iteration for the left one of the same lambda, which is
/// that of the two-sided Rayleigh quotient in the end. Beside lock-in inverse iteration of both sides at once may lead
/// them to two modes, which share nothing: the quotient is of any size then.
void refine(const LossyMatrices& problem, TwoSidedPair& pair)
{
  DenseEigenpair right{pair.lambda, pair.right};
  if (solve_lossy(problem, right))
  {
    pair.lambda = right.lambda;
    pair.right = right.y;
  }
  const Eigen::PartialPivLU<MatrixXcd> factor(sum(problem, loss_factors(pair.lambda * (1 + beside))));
  for (int iteration = 0; iteration < 2; ++iteration)
  {
    pair.right = factor.solve(pair.right).normalized();
    pair.left = factor.transpose().solve(pair.left).normalized();
  }
  take_quotient(problem, pair);
}

/// Residuals of the vectors of a side, and their backward errors.
struct Residuals
{
  MatrixXcd columns;
  VectorXd errors;
};

Residuals residuals_of(const LossyMatrices& problem, std::span<const TwoSidedPair> pairs, VectorXcd TwoSidedPair::*side)
{
  const MatrixXcd x = vectors_of(pairs, side);
  Residuals result{MatrixXcd::Zero(x.rows(), x.cols()), {}};
  VectorXd sizes = VectorXd::Zero(x.cols());
  for (std::size_t k = 0; k < problem.size(); ++k)
  {
    MatrixXcd part = side == &TwoSidedPair::right ? real_times(problem[k], x) : real_times(problem[k].transpose(), x);
    for (Index i = 0; const TwoSidedPair& pair : pairs) part.col(i++) *= loss_factors(pair.lambda)[k];
    result.columns += part;
    sizes += part.colwise().norm().transpose();
  }
  result.errors = result.columns.colwise().norm().transpose().cwiseQuotient(sizes);
  return result;
}

/// Pairs of a problem that are nearly those on the span of the orthonormal V become the latter.
void solve_on(const MatrixXd& V, const LossyMatrices& problem, std::span<TwoSidedPair> pairs)
{
  LossyMatrices on_span;
  for (std::size_t k = 0; k < problem.size(); ++k) on_span[k] = V.transpose() * problem[k] * V;
  for (TwoSidedPair& pair : pairs)
  {
    TwoSidedPair small{pair.lambda, (V.transpose() * pair.right).normalized(), {}};
    if (!solve_at(on_span, 1, small.lambda, small.right)) continue;
    find_left(on_span, 1, small);
    pair = {small.lambda, V * small.right, V * small.left};
  }
}

/// Makes pairs that are nearly those of a problem its own. Of a large one they are solved on the span of V, which holds
/// them nearly and takes in what one factor at their mean lambda makes of the residuals. Newton's method would factor
/// the problem for each pair and step: it ends those that do not settle.
void refine_together(const LossyMatrices& problem, MultiVector V, std::span<TwoSidedPair> pairs)
{
  if (pairs.empty()) return;
  constexpr int passes = 12;
  constexpr double exact = 1e-10; // of a side: lambda is off by its square over the distance to others, below `settled`
                                  // down to distances of same_lambda
  VectorXd errors = VectorXd::Constant(static_cast<Index>(pairs.size()), HUGE_VAL);
  if (2 * V.columns() < V.entries.rows())
  {
    Complex mean = 0;
    for (const TwoSidedPair& pair : pairs) mean += pair.lambda / static_cast<double>(pairs.size());
    const Eigen::PartialPivLU<MatrixXcd> factor(sum(problem, loss_factors(mean)));
    for (int pass = 0; pass < passes; ++pass)
    {
      solve_on(V.entries, problem, pairs);
      const Residuals right = residuals_of(problem, pairs, &TwoSidedPair::right),
                      left = residuals_of(problem, pairs, &TwoSidedPair::left);
      errors = right.errors + left.errors; // NaN of either stays
      if ((errors.array() <= exact).all())
      {
        for (TwoSidedPair& pair : pairs) take_quotient(problem, pair); // the span has rounding of its own
        return;
      }
      if (!errors.allFinite()) break;
      extend_orthonormal(V, {V.comm, parts_of(factor.solve(right.columns))});
      extend_orthonormal(V, {V.comm, parts_of(factor.transpose().solve(left.columns))});
    }
  }
  for (Index k = 0; TwoSidedPair & pair : pairs)
    if (!(errors(k++) <= exact)) refine(problem, pair);
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
OnSpan on_span(const LossyMatrices& problem, const std::vector<TwoSidedPair>& pairs)
{
  constexpr double independent = 1e-6; // of a start
  const MatrixXd R = parts_of(vectors_of(pairs, &TwoSidedPair::right)),
                 L = parts_of(vectors_of(pairs, &TwoSidedPair::left));
  Eigen::JacobiSVD<MatrixXd> svd(L.transpose() * problem[0] * R, Eigen::ComputeThinU | Eigen::ComputeThinV);
  svd.setThreshold(independent);
  const Index rank = svd.rank();
  OnSpan result{R * svd.matrixV().leftCols(rank), {}, {}};
  result.coordinates =
      svd.singularValues().head(rank).cwiseInverse().asDiagonal() * (L * svd.matrixU().leftCols(rank)).transpose();
  for (std::size_t k = 0; k < 4; ++k) result.problem[k] = result.coordinates * problem[k] * result.V;
  return result;
}

/// What pairs without losses become, but for their left vectors.
void follow_losses(const LossyMatrices& problem, std::vector<TwoSidedPair>& pairs)
{
  std::vector<DenseEigenpair> without;
  for (const TwoSidedPair& pair : pairs) without.push_back({pair.lambda, pair.right});
  const std::vector<DenseEigenpair> with = with_losses(problem, without);
  for (std::size_t k = 0; k < pairs.size(); ++k)
  {
    pairs[k].lambda = with[k].lambda;
    pairs[k].right = with[k].y;
  }
}

void add_losses(const LossyMatrices& problem, std::vector<TwoSidedPair>& pairs)
{
  std::vector<Complex> eigenvalues;
  for (const TwoSidedPair& pair : pairs) eigenvalues.push_back(pair.lambda);
  std::vector<std::size_t> places; // of those with losses
  std::vector<TwoSidedPair> with;
  for (const NeighbouringPairs& group : neighbouring_pairs(eigenvalues, usual_group))
  {
    std::vector<TwoSidedPair> near;
    for (const std::size_t place : group.places) near.push_back(pairs[place]);
    const auto [V, coordinates, small] = on_span(problem, near);
    for (TwoSidedPair& pair : near) pair.right = (coordinates * (problem[0] * pair.right)).normalized();
    follow_losses(small, near);
    for (TwoSidedPair& pair : near) pair.right = (V * pair.right).normalized();
    MultiVector both{MPI_COMM_SELF, MatrixXd(V.rows(), 0)}; // left vectors are those without losses
    for (VectorXcd TwoSidedPair::*side : {&TwoSidedPair::right, &TwoSidedPair::left})
      extend_orthonormal(both, {both.comm, parts_of(vectors_of(near, side))});
    const std::size_t middle = (group.first + group.end) / 2; // the mean of half of them is nearer to each
    for (const auto& [first, end] : {std::pair{group.first, middle}, std::pair{middle, group.end}})
      refine_together(problem, both, std::span(near).subspan(first, end - first));
    for (std::size_t k = group.first; k < group.end; ++k)
    {
      places.push_back(group.places[k]);
      with.push_back(std::move(near[k]));
    }
  }
  if (const std::vector<std::size_t> again = doubled(with); !again.empty())
  {
    std::vector<TwoSidedPair> on_all;
    for (const std::size_t k : again) on_all.push_back(pairs[places[k]]);
    follow_losses(problem, on_all);
    for (std::size_t i = 0; i < again.size(); ++i)
    {
      refine(problem, on_all[i]);
      with[again[i]] = std::move(on_all[i]);
    }
  }
  for (std::size_t k = 0; k < places.size(); ++k) pairs[places[k]] = std::move(with[k]);
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
