#include "squeal/modes/passes.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/QR>
#include <span>

namespace squeal
{

namespace
{

using Pairs = std::span<const DenseEigenpair>;

constexpr std::size_t at_once = 64; // pairs expanded at a time
// Columns of V, over those that a restart keeps. Pairs that friction turns far take eight passes and more. Their dense
// problems would take most of the time; with half as many columns twice as many passes follow.
constexpr Index most_of_kept = 2;

/// V, and V'A V of M, C, K and K_loss, which may be null. Products A V are not kept.
struct Subspace
{
  MultiVector V; // orthonormal
  std::array<Mat, 4> matrices{};
  std::array<Owned<Mat>, 4> transposed{}; // once they are asked for
  std::array<double, 4> norms{};          // 1-norms
  LossyMatrices entries{};
};

Subspace empty_subspace(const std::array<Mat, 4>& matrices)
{
  Subspace space{empty_multivector(matrices[2]), matrices};
  for (std::size_t k = 0; k < matrices.size(); ++k)
    if (matrices[k]) space.norms[k] = norm_of(matrices[k], NORM_1);
  return space;
}

/// V gains what X adds to its span, W: V'A V gains the columns V'A W and the rows (A'W)'V. Returns whether that is
/// anything.
bool extend(Subspace& space, MultiVector X)
{
  const Index size = space.V.columns();
  if (X.columns() == 0 || size >= row_count(space.matrices[2]) || extend_orthonormal(space.V, std::move(X)) == 0)
    return false;
  const MultiVector W = columns_from(space.V, size), before{W.comm, space.V.entries.leftCols(size)};
  for (std::size_t k = 0; k < space.matrices.size(); ++k)
  {
    if (!space.matrices[k]) continue;
    MatrixXd& entries = space.entries[k];
    entries.conservativeResize(space.V.columns(), space.V.columns());
    entries.rightCols(W.columns()) = inner_products(space.V, product(space.matrices[k], W));
    if (size == 0) continue;
    Owned<Mat>& transposed = space.transposed[k];
    if (!transposed.get()) transposed = transpose_of(space.matrices[k]);
    entries.bottomLeftCorner(W.columns(), size) = inner_products(product(transposed, W), before);
  }
  return true;
}

/// f_term y of each pair: the real parts of all, then the imaginary parts.
MatrixXd coefficients(Pairs pairs, std::size_t term)
{
  Eigen::MatrixXcd columns(pairs.front().right.size(), static_cast<Index>(pairs.size()));
  for (Index k = 0; const DenseEigenpair& pair : pairs) columns.col(k++) = loss_factors(pair.lambda)[term] * pair.right;
  return parts_of(columns);
}

/// Some pairs V a and their residuals: the real parts of all, then the imaginary parts.
struct Expanded
{
  Pairs pairs;
  MultiVector y, residuals{};
  Eigen::VectorXd sizes{}; // of the residuals' columns, over the sizes of a pair's terms

  Index count() const { return static_cast<Index>(pairs.size()); }
  double backward_error(Index pair) const { return std::hypot(sizes(pair), sizes(count() + pair)); }
};

Expanded expand(const Subspace& space, Pairs pairs)
{
  Expanded result{pairs, combination(space.V, coefficients(pairs, 2))};
  const Index count = result.count();
  result.residuals = {space.V.comm, MatrixXd::Zero(space.V.entries.rows(), 2 * count)};
  Eigen::VectorXd scale = Eigen::VectorXd::Zero(2 * count);
  for (std::size_t k = 0; k < space.matrices.size(); ++k)
  {
    if (!space.matrices[k]) continue;
    const MatrixXd image = product(space.matrices[k], result.y).entries;
    for (Index pair = 0; pair < count; ++pair)
    {
      const std::complex<double> f = loss_factors(pairs[static_cast<std::size_t>(pair)].lambda)[k];
      const auto re = image.col(pair), im = image.col(count + pair);
      result.residuals.entries.col(pair) += f.real() * re - f.imag() * im;
      result.residuals.entries.col(count + pair) += f.imag() * re + f.real() * im;
      scale(pair) += std::abs(f) * space.norms[k];
      scale(count + pair) = scale(pair);
    }
  }
  result.sizes = column_norms(result.residuals).cwiseQuotient(scale);
  return result;
}

/// Calls visit(Expanded) for so many pairs at a time that they take little memory.
template <class Visit> void for_expanded(const Subspace& space, Pairs pairs, Visit visit)
{
  for (std::size_t first = 0; first < pairs.size(); first += at_once)
    visit(expand(space, pairs.subspan(first, std::min(at_once, pairs.size() - first))));
}

/// The pairs of the small problem in the window, those to be corrected first in front.
std::vector<DenseEigenpair> solve_small(const Subspace& space, const Correction& correction)
{
  std::vector<DenseEigenpair> found = solve_lossy_shared(space.V.comm, space.entries);
  std::erase_if(found, [&](const DenseEigenpair& pair) { return !correction.window.holds(pair.lambda); });
  const auto rank = [&](const DenseEigenpair& pair)
  { return correction.near ? std::abs(pair.lambda - *correction.near) : -pair.lambda.real() / std::abs(pair.lambda); };
  std::ranges::sort(found, {}, rank);
  return found;
}

/// V keeps the span of its first columns and of the pairs alone. Collective.
void restart(Subspace& space, Index first, Pairs pairs)
{
  constexpr double dependent = 1e-10; // of kept vectors, over the largest
  const Index size = space.V.columns();
  MatrixXd Q; // rank 0's: other processors may find another rank
  on_rank_zero(space.V.comm,
               [&]
               {
                 MatrixXd kept(size, first + 2 * static_cast<Index>(pairs.size()));
                 kept << MatrixXd::Identity(size, first), coefficients(pairs, 2);
                 Eigen::ColPivHouseholderQR<MatrixXd> orthogonal(kept);
                 orthogonal.setThreshold(dependent);
                 Q = orthogonal.householderQ() * MatrixXd::Identity(size, orthogonal.rank());
               });
  broadcast(Q, space.V.comm);
  combine(space.V, Q);
  for (MatrixXd& entries : space.entries)
    if (entries.size() > 0) entries = Q.transpose() * entries * Q;
}

/// The residuals of pairs that are not small enough.
MultiVector residuals_left(const Subspace& space, Pairs pairs, const Correction& correction)
{
  MultiVector left = empty_multivector(space.matrices[2]);
  for_expanded(space, pairs,
               [&](const Expanded& some)
               {
                 std::vector<Index> kept;
                 for (Index k = 0; k < some.count(); ++k)
                   for (const Index column : {k, some.count() + k})
                     if (some.sizes(column) > correction.tolerance_of(some.pairs[static_cast<std::size_t>(k)].lambda))
                       kept.push_back(column);
                 append(left, {left.comm, some.residuals.entries(Eigen::all, kept)});
               });
  return left;
}

/// y = V a of all pairs.
std::vector<Eigenpair> pairs_of(const Subspace& space, Pairs pairs)
{
  std::vector<Eigenpair> result;
  for_expanded(space, pairs,
               [&](const Expanded& some)
               {
                 for (Index k = 0; k < some.count(); ++k)
                 {
                   Eigenpair& pair = result.emplace_back();
                   pair.lambda = some.pairs[static_cast<std::size_t>(k)].lambda;
                   pair.backward_error = some.backward_error(k);
                   check(MatCreateVecs(space.matrices[2], pair.real.put(), pair.imaginary.put()));
                   copy_column(some.y, k, pair.real);
                   copy_column(some.y, some.count() + k, pair.imaginary);
                 }
               });
  return result;
}

/// An orthonormal basis of the residuals' directions, down to `share` of the largest. No column counts for more than
/// 30 times the median. A combination of corrections that is in the window, but no pair, would outweigh all others.
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

QuadraticSolution solve_on_subspace(const QuadraticProblem& problem, Mat K_loss, MultiVector basis,
                                    const PencilFactor* P, const Correction& correction)
{
  QuadraticSolution result;
  Subspace space = empty_subspace({problem.M, problem.C, problem.K, K_loss});
  extend(space, std::move(basis));
  const Index first = space.V.columns();
  for (int pass = 0;; ++pass)
  {
    end_if_asked(comm_of(problem.K));
    const std::vector<DenseEigenpair> found = solve_small(space, correction);
    const auto is_better = [&]
    {
      MultiVector left =
          residuals_left(space, Pairs(found).first(std::min(found.size(), correction.pairs)), correction);
      if (left.columns() == 0) return false;
      MultiVector more = P->solve(largest_directions(std::move(left), correction.share));
      const Index kept = first + 2 * static_cast<Index>(found.size());
      if (space.V.columns() + more.columns() > most_of_kept * kept) restart(space, first, found);
      return extend(space, std::move(more));
    };
    if (pass < correction.passes && is_better()) continue;
    result.outcome.iterations = pass;
    result.pairs = pairs_of(space, found);
    sort_and_measure(result);
    return result;
  }
}

QuadraticSolution solve_whole(const QuadraticProblem& problem, Mat K_loss, const Window& window)
{
  MultiVector unit = empty_multivector(problem.K);
  unit.entries.setZero(unit.entries.rows(), row_count(problem.K));
  unit.entries.middleCols(own_rows(problem.K).first, unit.entries.rows()).setIdentity();
  QuadraticSolution result = solve_on_subspace(problem, K_loss, std::move(unit), nullptr, {.window = window});
  result.outcome.kind = OutcomeKind::converged;
  return result;
}

MultiVector span_of(std::span<const Eigenpair> pairs, Mat layout)
{
  constexpr double independent = 1e-6; // of a direction, over the largest
  MultiVector basis = empty_multivector(layout);
  for (const Eigenpair& pair : pairs)
    for (const Vec part : {pair.real.get(), pair.imaginary.get()}) append(basis, part);
  if (!pairs.empty()) orthonormalise(basis, independent * independent);
  return basis;
}

namespace
{

constexpr double two_sided_tolerance = 1e-13; // backward error: derivatives are off by it to first order
constexpr int two_sided_passes = 60;          // each adds two vectors to a side, with which small problems stay small
constexpr double beside = 1e-4; // of tau from -Re(lambda^2), which is an eigenvalue of the pencil without damping

/// The pair nearest lambda, from a first vector.
Eigenpair nearest_pair(const QuadraticProblem& problem, Mat K_loss, const MultiVector& start, const PencilFactor& P,
                       Complex lambda)
{
  constexpr double lowest = 0.7, highest = 1.4; // of |lambda|
  const double square = std::norm(lambda);
  QuadraticSolution found = solve_on_subspace(problem, lambda.imag() == 0 ? nullptr : K_loss, start, &P,
                                              {.window = {lowest * lowest * square, highest * highest * square},
                                               .passes = two_sided_passes,
                                               .pairs = 1,
                                               .tolerance = two_sided_tolerance,
                                               .sharp = two_sided_tolerance,
                                               .near = lambda});
  Eigenpair nearest{HUGE_VAL, {}, {}, HUGE_VAL};
  for (Eigenpair& pair : found.pairs)
    if (std::abs(pair.lambda - lambda) < std::abs(nearest.lambda - lambda)) nearest = std::move(pair);
  return nearest;
}

MultiVector parts_of(const Eigenpair& pair)
{
  return columns_of(std::array{pair.real.get(), pair.imaginary.get()});
}

/// By the two-sided Rayleigh quotient.
Complex change_of_lambda(const TwoSidedProblem& problem, const TwoSidedMode& mode)
{
  const Complex lambda = mode.lambda;
  const auto on_both = [&](Mat A) { return A ? bilinear(mode.left, product(A, mode.right)) : 0; };
  const auto& [M, C, K] = problem.right;
  const Complex mass = on_both(M), damping = on_both(C);
  const Complex residual =
      lambda * lambda * mass + lambda * damping + on_both(K) + loss_factor_of(lambda) * on_both(problem.K_loss);
  return -residual / (2. * lambda * mass + damping);
}

} // namespace

Complex bilinear(const MultiVector& x, const MultiVector& y)
{
  const Eigen::MatrixXd products = inner_products(x, y);
  return {products(0, 0) - products(1, 1), products(0, 1) + products(1, 0)};
}

TwoSidedProblem make_two_sided(const QuadraticProblem& matrices, Mat K_loss, Mat K_z, Mat M_z,
                               const PencilOptions& options)
{
  return {matrices,
          K_loss,
          {transpose_of(matrices.M), transpose_of(matrices.C), transpose_of(matrices.K)},
          K_loss ? transpose_of(K_loss) : Owned<Mat>{},
          make_shift_invert(K_z, M_z, Keep::factor, options)};
}

TwoSidedMode find_two_sided(TwoSidedProblem& problem, Complex lambda, const MultiVector& start)
{
  move_to(problem.pencil, -(1 + beside) * (lambda * lambda).real());
  const PencilFactor& P = *problem.pencil.factor;
  const Eigenpair right = nearest_pair(problem.right, problem.K_loss, start, P, lambda),
                  left =
                      nearest_pair(problem.left, problem.K_loss_t, P.solve(product(problem.left.M, start)), P, lambda);
  TwoSidedMode mode{right.lambda, {}, {}, std::max(right.backward_error, left.backward_error)};
  if (!std::isfinite(mode.backward_error)) return mode;
  mode.right = parts_of(right);
  mode.left = parts_of(left);
  mode.lambda += change_of_lambda(problem, mode);
  if (lambda.imag() == 0) mode.lambda.imag(0);
  return mode;
}

} // namespace squeal
