#include "squeal/modes/real_modes.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/algebra/multivector.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

double trace(Mat A)
{
  double result = 0;
  check(MatGetTrace(A, &result));
  return result;
}

/// All pairs of a small problem, on every rank.
SymmetricEigenpairs solve_whole(Mat M, Mat K)
{
  return solve_dense_symmetric_shared(comm_of(K), dense_copy(M), dense_copy(K), shift_below_zero(M, K));
}

/// The first `count` of them.
RealModes first_of(const SymmetricEigenpairs& all, Mat K, Index count)
{
  RealModes modes;
  modes.outcome = {OutcomeKind::converged, "", 1, 0};
  for (Index k = 0; k < std::min(count, all.lambda.size()); ++k)
  {
    Owned<Vec> shape = vector_of_columns(K);
    set_all_entries(shape, {all.y.col(k).data(), static_cast<std::size_t>(all.y.rows())});
    modes.omega.push_back(std::sqrt(std::max(0.0, all.lambda(k))));
    modes.shapes.push_back(std::move(shape));
  }
  return modes;
}

/// Ascending theta = omega^2 and M-normalised shapes.
struct RealPairs
{
  Eigen::VectorXd theta{};
  MultiVector x;

  int number_below(double limit) const { return static_cast<int>((theta.array() < limit).count()); }
};

/// theta and shapes on the span of X. Beside the motions of a free body 1/(theta - shift) varies by 1e7, and SLEPc's
/// theta are off by that times the rounding. Here the dense problem is shifted by the mean theta instead.
RealPairs ritz_pairs(const MultiVector& X, Mat M, Mat K)
{
  const Eigen::MatrixXd mass = inner_products(X, product(M, X)), stiffness = inner_products(X, product(K, X));
  const double mean = stiffness.trace() / mass.trace();
  const SymmetricEigenpairs ritz =
      solve_dense_symmetric_shared(X.comm, mass, stiffness, std::min(-mean, shift_below_zero(M, K)));
  return {ritz.lambda, combination(X, ritz.y)};
}

/// The largest |K x - theta M x| / (|K| |x|).
double largest_residual(const RealPairs& pairs, Mat M, Mat K)
{
  if (pairs.x.columns() == 0) return 0;
  MultiVector residual = product(K, pairs.x);
  residual.entries -= product(M, pairs.x).entries * pairs.theta.asDiagonal();
  return (column_norms(residual).array() / column_norms(pairs.x).array()).maxCoeff() / norm_of(K, NORM_1);
}

/// Appends the modes with low <= theta < high, found from the middle, about `expected` of them. Where they are too many
/// for one space, by halves.
void append_between(double low, double high, int expected, ShiftInvert& pencil, RealModes& modes)
{
  constexpr double tolerance = 1e-7; // of the subspace: theta is off by its square
  const double middle = (low + high) / 2;
  move_to(pencil, middle);
  const double radius = (high - low) / 2 + std::abs(pencil.shift - middle);
  const Nearest nearest = solve_nearest(pencil, std::max(expected, 1), radius, tolerance);
  if (!nearest.converged)
  {
    append_between(low, middle, expected / 2, pencil, modes);
    append_between(middle, high, expected / 2, pencil, modes);
    return;
  }
  RealPairs found = ritz_pairs(nearest.space, pencil.M, pencil.K);
  const Index first = found.number_below(low), count = found.number_below(high) - first;
  found = {found.theta.segment(first, count).eval(), {found.x.comm, found.x.entries.middleCols(first, count)}};
  modes.outcome.residual = std::max(modes.outcome.residual, largest_residual(found, pencil.M, pencil.K));
  for (Index k = 0; k < count; ++k)
  {
    modes.omega.push_back(std::sqrt(std::max(0.0, found.theta[k])));
    modes.shapes.push_back(vector_of_columns(pencil.K));
    copy_column(found.x, k, modes.shapes.back());
  }
}

void keep_first(RealModes& modes, std::ptrdiff_t count)
{
  modes.omega.erase(modes.omega.begin() + count, modes.omega.end());
  modes.shapes.erase(modes.shapes.begin() + count, modes.shapes.end());
}

/// The modes with theta < limit, in slices of equal width in frequency with about `slice` modes each. The work of a
/// slice grows by the square of their number. A mode on an edge may be missed or found twice, which the count shows:
/// then other edges follow.
RealModes search_below(Mat M, Mat K, double limit, const PencilOptions& options)
{
  constexpr int slice = 150, attempts = 3;
  constexpr double rounding = 1e-8; // of theta: the inertia says on which side of the limit such a mode lies
  const EliminationOrder order = elimination_order(K);
  const Inertia end = inertia_at(limit, M, K, options, order);
  ShiftInvert pencil = make_shift_invert(K, M, Keep::factor, options, &order);
  const int fewest = std::max(1, (end.below + slice - 1) / slice);
  for (int slices = fewest;; ++slices)
  {
    RealModes modes{{OutcomeKind::converged, "", slices, 0}, {}, {}};
    for (int k = 0; k < slices; ++k)
    {
      const double low = k == 0 ? shift_below_zero(M, K) : limit * std::pow(1. * k / slices, 2);
      const double high = limit * (k + 1 == slices ? 1 + rounding : std::pow((k + 1.) / slices, 2));
      append_between(low, high, end.below / slices, pencil, modes);
    }
    const auto below = [&](double theta)
    { return std::ranges::lower_bound(modes.omega, std::sqrt(theta)) - modes.omega.begin(); };
    const bool counted =
        below(end.limit * (1 - rounding)) <= end.below && end.below <= below(end.limit * (1 + rounding));
    if (!counted && slices + 1 < fewest + attempts) continue;
    if (!counted)
    {
      modes.outcome.kind = OutcomeKind::not_converged;
      modes.outcome.reason = format("%td real modes found, and the inertia counts %d", below(end.limit), end.below);
    }
    keep_first(modes, counted && end.limit == limit ? end.below : below(limit));
    return modes;
  }
}

void to_structure(RealModes& modes, Mat Z)
{
  for (Owned<Vec>& shape : modes.shapes) shape = product(Z, shape);
}

} // namespace

double shift_below_zero(Mat M, Mat K)
{
  return -1e-8 * std::abs(trace(K)) / trace(M);
}

Inertia inertia_at(double limit, Mat M, Mat K, const PencilOptions& options, const EliminationOrder& order)
{
  ShiftInvert pencil = make_shift_invert(K, M, Keep::count, options, &order);
  move_to(pencil, limit);
  return {pencil.shift, pencil.factor->negative_pivots()};
}

RealModes solve_real_modes_below(Mat M, Mat K, double band, const ModesOptions& options)
{
  const double omega = two_pi * band;
  if (row_count(K) > options.dense_limit) return search_below(M, K, omega * omega, options.pencil);
  const SymmetricEigenpairs all = solve_whole(M, K);
  const auto below = std::lower_bound(all.lambda.begin(), all.lambda.end(), omega * omega);
  return first_of(all, K, below - all.lambda.begin());
}

RealModes find_real_modes_below(const LinearisedSliding& linearised, double band, const ModesOptions& options)
{
  RealModes modes = solve_real_modes_below(linearised.M_z, linearised.K_z, band, options);
  to_structure(modes, linearised.contact.Z);
  return modes;
}

RealModes find_real_modes_between(const LinearisedSliding& linearised, double low, double high,
                                  const ModesOptions& options)
{
  if (!(low < high)) return {{OutcomeKind::converged, "", 0, 0}, {}, {}};
  if (low <= 0 || row_count(linearised.K_z) <= options.dense_limit)
    return find_real_modes_below(linearised, high, options);
  const auto theta = [](double frequency_hz) { return std::pow(two_pi * frequency_hz, 2); };
  ShiftInvert pencil = make_shift_invert(linearised.K_z, linearised.M_z, Keep::factor, options.pencil);
  RealModes modes{{OutcomeKind::converged, "", 0, 0}, {}, {}};
  append_between(theta(low), theta(high), 1, pencil, modes);
  to_structure(modes, linearised.contact.Z);
  return modes;
}

} // namespace squeal
