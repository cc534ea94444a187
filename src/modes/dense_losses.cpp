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
constexpr int newton_steps = 60;      // each divides the error of omega by about 2/eta^2
constexpr double settled = 1e-12;     // last change of lambda over |lambda|: beyond, there is no fixed point
constexpr double sensitive = 1e-9;    // the same of a lambda that rounding keeps from settling, by its condition
constexpr double rounding = 1e-15;    // of lambda
constexpr double beside = 1e-13;      // of lambda: where no pivot vanishes
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

/// Loss factors on their way from none: a share of i + own Re(lambda)/Im(lambda). They grow to those of the complex
/// problem first, which has no fixed point to find, and become their viscous equivalent from there.
struct Losses
{
  double share = 0, own = 0;
};

constexpr Losses none{0, 0}, complex_loss{1, 0}, viscous_loss{1, 1};

Losses losses_of(LossKind kind)
{
  return kind == LossKind::viscous ? viscous_loss : complex_loss;
}

ComplexFactors factors_at(const Losses& losses, Complex lambda)
{
  return {lambda * lambda, lambda, 1, losses.share * Complex(losses.own * lambda.real() / lambda.imag(), 1)};
}

/// Derivatives of the factors in lambda, at a constant omega.
ComplexFactors derivatives_at(const Losses& losses, Complex lambda)
{
  return {2. * lambda, 1, 0, losses.share * losses.own / lambda.imag()};
}

/// Newton's method on (lambda, y), with omega taken from the last lambda. Returns whether it found a pair that
/// oscillates.
bool solve_at(const LossyMatrices& problem, const Losses& losses, Complex& lambda, VectorXcd& y)
{
  const auto oscillates = [&] { return lambda.imag() > settled * std::abs(lambda); };
  double last = HUGE_VAL;
  for (int step = 0; step < newton_steps && last > rounding; ++step)
  {
    if (!oscillates()) return false;
    const VectorXcd x = Eigen::PartialPivLU<MatrixXcd>(sum(problem, factors_at(losses, lambda)))
                            .solve(sum(problem, derivatives_at(losses, lambda)) * y);
    if (!x.allFinite()) return true; // singular: lambda is an eigenvalue to rounding
    const Complex change = y.squaredNorm() / y.dot(x);
    const double now = std::abs(change) / std::abs(lambda);
    if (last <= settled && now > last) return true; // beside a multiple eigenvalue x is rounding
    y = x.normalized();
    lambda -= change;
    if (now / last * now <= rounding && std::isfinite(last)) return oscillates(); // what the next step would change
    last = now;
  }
  return last <= sensitive && oscillates();
}

/// The left vector that belongs to lambda and the right one, by inverse iteration from its conjugate: their product
/// without conjugation, which says how much of the left vector the start has, is 1.
void find_left(const LossyMatrices& problem, const Losses& losses, TwoSidedPair& pair)
{
  const Eigen::PartialPivLU<MatrixXcd> factor(sum(problem, factors_at(losses, pair.lambda * (1 + beside))));
  pair.left = pair.right.conjugate();
  for (int iteration = 0; iteration < 2; ++iteration) pair.left = factor.transpose().solve(pair.left).normalized();
}

/// The pairs after a change of their losses, to first order in it but for what omega changes: the problem on the states
/// (y, lambda y) of all of them, where near neighbours mix at once while no two become one. Each keeps the place that
/// it has most of.
std::vector<TwoSidedPair> changed_together(const LossyMatrices& problem, const std::vector<TwoSidedPair>& pairs,
                                           const Losses& from, const Losses& to)
{
  const auto count = static_cast<Index>(pairs.size());
  const MatrixXcd right = vectors_of(pairs, &TwoSidedPair::right), left = vectors_of(pairs, &TwoSidedPair::left);
  MatrixXcd H = left.transpose() * (problem[3] * right);
  const VectorXcd mass = (left.array() * (problem[0] * right).array()).colwise().sum(),
                  damping = (left.array() * (problem[1] * right).array()).colwise().sum();
  for (Index i = 0; i < count; ++i)
  {
    const Complex lambda = pairs[static_cast<std::size_t>(i)].lambda;
    H.row(i) *= (factors_at(from, lambda)[3] - factors_at(to, lambda)[3]) / (2. * lambda * mass(i) + damping(i));
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

/// Continuation of pairs together from the one kind of losses to the other, in at least so many steps: in shorter ones
/// where Newton's method fails or leads two pairs to one. Nothing is left of pairs that end on the way.
std::vector<std::optional<TwoSidedPair>> follow(const LossyMatrices& problem, std::vector<TwoSidedPair> pairs,
                                                const Losses& from, const Losses& to, int steps)
{
  constexpr double shortest = 1. / 64; // of a step: a pair that fails in these has ended
  std::vector<std::optional<TwoSidedPair>> result(pairs.size());
  std::vector<std::size_t> places(pairs.size());
  std::iota(places.begin(), places.end(), 0);
  const auto between = [&](double part) {
    return Losses{from.share + part * (to.share - from.share), from.own + part * (to.own - from.own)};
  };
  double at = 0, step = 1. / steps;
  bool apart = true;
  for (TwoSidedPair& pair : pairs) find_left(problem, from, pair);
  while (at < 1 && !pairs.empty())
  {
    const double next = at + 1.5 * step < 1 ? at + step : 1;
    const Losses losses = between(next);
    std::vector<TwoSidedPair> tried = changed_together(problem, pairs, between(at), losses);
    std::vector<char> found;
    for (TwoSidedPair& pair : tried) found.push_back(solve_at(problem, losses, pair.lambda, pair.right) ? 1 : 0);
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
        if (next < 1) find_left(problem, losses, tried[k]);
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

bool solve_lossy(const LossyMatrices& problem, LossKind kind, DenseEigenpair& pair)
{
  return solve_at(problem, losses_of(kind), pair.lambda, pair.y);
}

bool solve_lossy_beside(const LossyMatrices& problem, LossKind kind, std::span<const DenseEigenpair> others,
                        DenseEigenpair& pair)
{
  constexpr int apart = 4; // steps: what is left of the others is of rounding, and their lambdas are not its own
  const Losses losses = losses_of(kind);
  std::vector<std::pair<VectorXcd, Eigen::RowVectorXcd>> known; // a pair's vector, and what takes its part of another
  for (const DenseEigenpair& other : others)
  {
    TwoSidedPair both{other.lambda, other.y, {}};
    find_left(problem, losses, both);
    const Eigen::RowVectorXcd row = both.left.transpose() * sum(problem, derivatives_at(losses, both.lambda));
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
    const VectorXcd x = without_others(Eigen::PartialPivLU<MatrixXcd>(sum(problem, factors_at(losses, pair.lambda)))
                                           .solve(sum(problem, derivatives_at(losses, pair.lambda)) * pair.y));
    if (!x.allFinite()) return false;
    pair.y = x;
    const Complex residual = x.dot(sum(problem, factors_at(losses, pair.lambda)) * x),
                  slope = x.dot(sum(problem, derivatives_at(losses, pair.lambda)) * x);
    pair.lambda -= residual / slope;
  }
  return solve_lossy(problem, kind, pair);
}

bool are_one(const DenseEigenpair& a, const DenseEigenpair& b, const Sameness& limits)
{
  return are_one(a.lambda, a.y, b.lambda, b.y, limits);
}

bool is_equivalent(const DenseEigenpair& viscous, const DenseEigenpair& complex)
{
  return std::abs(viscous.lambda - complex.lambda) < 0.5 * std::abs(viscous.lambda);
}

std::optional<Complex> doubled_lambda(const std::vector<TwoSidedPair>& pairs)
{
  for (const std::size_t place : doubled(pairs))
    if (pairs[place].loss != LossKind::none) return pairs[place].lambda;
  return std::nullopt;
}

std::string describe_doubled(Complex lambda)
{
  return format("loss factors lead two modes to the one of %.6g Hz, so that a mode is missing", lambda.imag() / two_pi);
}

std::vector<LossyMode> with_losses(const LossyMatrices& problem, const std::vector<DenseEigenpair>& without)
{
  std::vector<TwoSidedPair> pairs;
  std::vector<LossyMode> modes;
  for (const DenseEigenpair& pair : without)
  {
    pairs.push_back({pair.lambda, pair.y, {}});
    modes.push_back({pair, pair, LossKind::complex});
  }
  const auto complex = follow(problem, std::move(pairs), none, complex_loss, steps_to_losses(problem, without));
  std::vector<std::size_t> places;
  pairs.clear();
  for (std::size_t k = 0; k < modes.size(); ++k)
  {
    if (!complex[k]) continue;
    modes[k].complex = {complex[k]->lambda, complex[k]->right};
    pairs.push_back(*complex[k]);
    places.push_back(k);
  }
  const auto viscous = follow(problem, std::move(pairs), complex_loss, viscous_loss, 1);
  for (std::size_t i = 0; i < places.size(); ++i)
  {
    LossyMode& mode = modes[places[i]];
    if (!viscous[i]) continue;
    mode.viscous = {viscous[i]->lambda, viscous[i]->right};
    if (is_equivalent(mode.viscous, mode.complex)) mode.taken = LossKind::viscous;
  }
  return modes;
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

/// Newton's method from the pair's right vector, then inverse iteration for the left one of the same lambda, which is
/// that of the two-sided Rayleigh quotient in the end. Beside lock-in inverse iteration of both sides at once may lead
/// them to two modes, which share nothing: the quotient is of any size then.
void refine(const LossyMatrices& problem, TwoSidedPair& pair)
{
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
    for (Index i = 0; const TwoSidedPair& pair : pairs) part.col(i++) *= loss_factors(pair.loss, pair.lambda)[k];
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
    TwoSidedPair small{pair.lambda, (V.transpose() * pair.right).normalized(), {}, pair.loss};
    const Losses losses = losses_of(pair.loss);
    if (!solve_at(on_span, losses, small.lambda, small.right)) continue;
    find_left(on_span, losses, small);
    pair = {small.lambda, V * small.right, V * small.left, pair.loss};
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
    // of viscous pairs f differs by Re/Im(lambda), which costs passes and no exactness
    const Eigen::PartialPivLU<MatrixXcd> factor(sum(problem, loss_factors(LossKind::complex, mean)));
    for (int pass = 0; pass < passes; ++pass)
    {
      solve_on(V.entries, problem, pairs);
      const Residuals right = residuals_of(problem, pairs, &TwoSidedPair::right),
                      left = residuals_of(problem, pairs, &TwoSidedPair::left);
      errors = right.errors + left.errors; // NaN of either stays
      if ((errors.array() <= exact).all()) return;
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
  const std::vector<LossyMode> modes = with_losses(problem, without);
  for (std::size_t k = 0; k < pairs.size(); ++k)
  {
    pairs[k].lambda = modes[k].pair().lambda;
    pairs[k].right = modes[k].pair().y;
    pairs[k].loss = modes[k].taken;
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
