#include "squeal/modes/projection.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/run_control.hpp"
#include "subspace.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/QR>
#include <iterator>
#include <span>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

/// The pairs of the small problem in the window, largest growth ratio first.
std::vector<DenseEigenpair> solve_small(const Subspace& space, const Window& window)
{
  std::vector<DenseEigenpair> found = solve_lossy_shared(space.V.comm, entries_of(space));
  std::erase_if(found, [&](const DenseEigenpair& pair) { return !window.holds(pair.lambda); });
  std::sort(found.begin(), found.end(),
            [](const DenseEigenpair& a, const DenseEigenpair& b)
            { return a.lambda.real() * std::abs(b.lambda) > b.lambda.real() * std::abs(a.lambda); });
  return found;
}

constexpr std::size_t at_once = 64; // pairs expanded at a time
// Columns of V, over those that a restart keeps. Pairs that friction turns far take eight passes and more, whose dense
// problems would take most of the time; with half as many columns twice as many passes follow.
constexpr Index most_of_kept = 2;

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
  combine(space, Q);
}

/// Calls visit(pairs, their residuals) for so many pairs at a time that these take little memory.
template <class Visit> void for_residuals(const Subspace& space, Pairs pairs, Visit visit)
{
  for (std::size_t first = 0; first < pairs.size(); first += at_once)
  {
    const Pairs some = pairs.subspan(first, std::min(at_once, pairs.size() - first));
    visit(some, residuals_of(space, some));
  }
}

/// The residuals of pairs that are not small enough.
MultiVector residuals_left(const Subspace& space, Pairs pairs, const Correction& correction)
{
  MultiVector left = empty_multivector(space.terms[2].matrix);
  for_residuals(space, pairs,
                [&](Pairs some, const Residuals& residuals)
                {
                  const auto count = static_cast<Index>(some.size());
                  std::vector<Index> kept;
                  for (Index k = 0; k < count; ++k)
                    for (const Index column : {k, count + k})
                      if (residuals.sizes(column) > correction.tolerance_of(some[static_cast<std::size_t>(k)].lambda))
                        kept.push_back(column);
                  append(left, {left.comm, residuals.columns.entries(Eigen::all, kept)});
                });
  return left;
}

/// y = V a of all pairs.
std::vector<Eigenpair> expand(const Subspace& space, Pairs pairs)
{
  std::vector<Eigenpair> result;
  for_residuals(space, pairs,
                [&](Pairs some, const Residuals& residuals)
                {
                  const auto count = static_cast<Index>(some.size());
                  const MultiVector y = vectors_of(space, some);
                  for (Index k = 0; k < count; ++k)
                  {
                    Eigenpair& pair = result.emplace_back();
                    pair.lambda = some[static_cast<std::size_t>(k)].lambda;
                    pair.backward_error = residuals.backward_error(k);
                    check(MatCreateVecs(space.terms[2].matrix, pair.real.put(), pair.imaginary.put()));
                    copy_column(y, k, pair.real);
                    copy_column(y, count + k, pair.imaginary);
                  }
                });
  return result;
}

/// An orthonormal basis of the residuals' directions, down to `share` of the largest. No column counts for more than
/// 30 times the median: a combination of corrections that is no pair but is in the window would outweigh all others.
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
                                    const PencilFactor& P, const Correction& correction)
{
  QuadraticSolution result;
  Subspace space = empty_subspace({problem.M, problem.C, problem.K, K_loss});
  extend(space, std::move(basis));
  const Index first = space.V.columns();
  for (int pass = 0;; ++pass)
  {
    end_if_asked(comm_of(problem.K));
    const std::vector<DenseEigenpair> found = solve_small(space, correction.window);
    const auto is_better = [&]
    {
      const Pairs corrected(found.data(), std::min(found.size(), static_cast<std::size_t>(correction.pairs)));
      MultiVector left = residuals_left(space, corrected, correction);
      if (left.columns() == 0) return false;
      MultiVector more = P.solve(largest_directions(std::move(left), correction.share));
      const Index kept = first + 2 * static_cast<Index>(found.size());
      if (space.V.columns() + more.columns() > most_of_kept * kept) restart(space, first, found);
      return extend(space, std::move(more));
    };
    if (pass < correction.passes && is_better()) continue;
    result.outcome.iterations = pass;
    result.pairs = expand(space, found);
    sort_and_measure(result);
    return result;
  }
}

QuadraticSolution solve_projected(const QuadraticProblem& problem, Mat M, Mat K, const RealModes& modes,
                                  const ProjectionSettings& settings)
{
  QuadraticSolution result;
  if (!modes.shapes.empty())
  {
    MultiVector shapes = empty_multivector(K);
    for (const Owned<Vec>& shape : modes.shapes) append(shapes, shape);
    ShiftInvert stiffness = make_shift_invert(K, M, Symmetry::symmetric, settings.pencil);
    if (settings.passes > 0) move_to(stiffness, shift_below_zero(M, K));
    const double omega = two_pi * settings.band;
    const Window window{vibration_floor(norms_of(problem)), omega * omega};
    result = solve_on_subspace(problem, nullptr, std::move(shapes), *stiffness.factor,
                               {window, settings.passes, settings.candidates, 1e-15, 1e-15, 0});
  }
  result.outcome.kind = modes.outcome.kind;
  result.outcome.reason = modes.outcome.reason;
  return result;
}

} // namespace squeal
