#include "squeal/modes/real_modes.hpp"

#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/multivector.hpp"
#include "squeal/base/integers.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

using Eigen::Index;

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
    Owned<Vec> shape;
    check(MatCreateVecs(K, shape.put(), nullptr));
    set_all_entries(shape, {all.y.col(k).data(), static_cast<std::size_t>(all.y.rows())});
    modes.omega.push_back(std::sqrt(std::max(0.0, all.lambda(k))));
    modes.shapes.push_back(std::move(shape));
  }
  return modes;
}

/// What a sweep must find: all theta = omega^2 below `limit`, or the first `count`.
struct Goal
{
  double limit = 0; // [1/s2]
  int count = 0;
};

/// What a sweep has found: ascending theta, and M-normalised shapes.
struct Found
{
  std::vector<double> theta{};
  MultiVector shapes;
  double covered = -HUGE_VAL; // every theta below is in the list
  bool complete = false;      // the goal is met, as the count of negative pivots says
  int iterations = 0;

  int count() const { return static_cast<int>(theta.size()); }
  int below(double limit) const
  {
    return static_cast<int>(std::lower_bound(theta.begin(), theta.end(), limit) - theta.begin());
  }
};

/// The middle of the widest gap between the values of the last third of an ascending list. A cluster is not cut there.
double widest_gap(const std::vector<double>& values)
{
  std::size_t best = values.size() - 1;
  for (std::size_t k = best; 3 * k >= 2 * values.size() && k > 0; --k)
    if (values[k] - values[k - 1] > values[best] - values[best - 1]) best = k;
  return (values[best] + values[best - 1]) / 2;
}

/// theta and M-normalised shapes of the symmetric problem on an invariant subspace.
SymmetricEigenpairs ritz_modes(const Nearest& nearest, Mat M, Mat K)
{
  const MultiVector& space = nearest.space;
  double largest = 0;
  for (const std::complex<double> theta : nearest.theta) largest = std::max(largest, std::abs(theta));
  return solve_dense_symmetric_shared(space.comm, inner_products(space, product(M, space)),
                                      inner_products(space, product(K, space)), -largest);
}

/// Appends the Ritz values between found.covered and a gap before `end`.
void append(Found& found, const SymmetricEigenpairs& ritz, const MultiVector& space, double end, double limit)
{
  std::vector<double> values = {found.covered};
  for (const double theta : ritz.lambda)
    if (theta > found.covered && theta < end) values.push_back(theta);
  values.push_back(end);
  found.covered = end >= limit ? limit : widest_gap(values);
  std::vector<Index> chosen;
  for (Index k = 0; k < ritz.lambda.size(); ++k)
    if (ritz.lambda(k) > values.front() && ritz.lambda(k) < found.covered)
    {
      chosen.push_back(k);
      found.theta.push_back(ritz.lambda(k));
    }
  append(found.shapes, combination(space, ritz.y(Eigen::all, chosen)));
}

/// The largest |K x - theta M x| / (|K| |x|).
double largest_residual(const Found& found, Mat M, Mat K)
{
  MultiVector residual = product(K, found.shapes);
  const auto theta = Eigen::VectorXd::Map(found.theta.data(), found.shapes.columns());
  residual.entries -= product(M, found.shapes).entries * theta.asDiagonal();
  double stiffness = 0;
  check(MatNorm(K, NORM_1, &stiffness));
  const Eigen::ArrayXd ratio = column_norms(residual).array() / (stiffness * column_norms(found.shapes).array());
  return ratio.size() > 0 ? ratio.maxCoeff() : 0;
}

// Numbers of values between what is covered and the next shift, and at most beyond that shift.
constexpr int below_shift = 20, above_shift = 40;

/// Raises the shift until about `below_shift` values lie between what is covered and the shift. Returns their number.
int raise_shift(ShiftInvert& pencil, const Found& found, double step, double limit)
{
  int between = 0;
  for (int attempt = 0; attempt < 6; ++attempt)
  {
    const double shift = std::min(found.covered + step, limit);
    move_to(pencil, shift);
    between = pencil.factor->negative_pivots() - found.count();
    if (between <= below_shift + below_shift / 4 && (2 * between >= below_shift || shift == limit)) break;
    step = (shift - found.covered) * std::min(3.0, below_shift / std::max(1.0, static_cast<double>(between)));
  }
  return between;
}

/// Drops the values above `verified`, which no count has confirmed.
void drop_unverified(Found& found, double verified)
{
  const int kept = found.below(verified);
  found.theta.resize(static_cast<std::size_t>(kept));
  found.shapes.entries.conservativeResize(Eigen::NoChange, kept);
  found.covered = verified;
}

/// Solves for `count` values about the shift, and appends them if `between` of them lie below the shift, as the inertia
/// demands. Returns whether it did.
bool extend(Found& found, const ShiftInvert& pencil, PetscInt count, int between, double limit)
{
  const Nearest nearest = solve_nearest(pencil, count, pencil.shift - found.covered, 1e-9);
  ++found.iterations;
  if (!nearest.converged) return false;
  const SymmetricEigenpairs ritz = ritz_modes(nearest, pencil.M, pencil.K);
  const auto below = std::count_if(ritz.lambda.begin(), ritz.lambda.end(),
                                   [&](double theta) { return theta > found.covered && theta < pencil.shift; });
  if (below != between) return false;
  append(found, ritz, nearest.space, pencil.shift + nearest.reach, limit);
  return true;
}

/// Raises shifts through the spectrum. The factor at each counts the values below it, and all of them must be found.
Found sweep(Mat M, Mat K, const Goal& goal)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  ShiftInvert pencil = make_shift_invert(K, M, Symmetry::symmetric);
  double verified = shift_below_zero(M, K); // the list is complete below
  Found found{.shapes = empty_multivector(K), .covered = verified};
  move_to(pencil, verified);
  for (int failures = 0, between = 0; failures < 4;)
  {
    const int missing = std::clamp(goal.count - found.count() - between + 2, 5, above_shift);
    const double start = std::max(0.0, found.covered);
    const int before = found.count();
    const bool good =
        extend(found, pencil, std::min<PetscInt>(n, between + missing * (1 + failures)), between, goal.limit);
    found.complete = good && std::isinf(found.covered); // the whole spectrum
    if (found.complete) break;
    failures = good ? 0 : failures + 1;
    if (good) verified = pencil.shift;
    if (good && found.covered < goal.limit && found.count() < goal.count)
    {
      const double spacing = (found.covered - start) / std::max(1, found.count() - before);
      between = raise_shift(pencil, found, below_shift * spacing, goal.limit);
      continue;
    }
    // The goal is met if the count agrees. If not, values are missing below, and a lower shift is nearer to them.
    if (good) move_to(pencil, found.covered);
    found.complete = good && pencil.factor->negative_pivots() == found.below(pencil.shift);
    if (found.complete) break;
    drop_unverified(found, verified);
    if (!good) move_to(pencil, (verified + pencil.shift) / 2);
    between = pencil.factor->negative_pivots() - found.count();
  }
  return found;
}

RealModes to_modes(const Found& found, Mat M, Mat K, int count)
{
  RealModes modes;
  modes.outcome = {OutcomeKind::converged, "", found.iterations, largest_residual(found, M, K)};
  if (!found.complete)
  {
    modes.outcome.kind = OutcomeKind::not_converged;
    modes.outcome.reason = std::to_string(found.count()) + " real modes found, and more are missing";
  }
  for (int k = 0; k < std::min(found.count(), count); ++k)
  {
    Owned<Vec> shape;
    check(MatCreateVecs(K, shape.put(), nullptr));
    copy_column(found.shapes, k, shape);
    modes.omega.push_back(std::sqrt(std::max(0.0, found.theta[static_cast<std::size_t>(k)])));
    modes.shapes.push_back(std::move(shape));
  }
  return modes;
}

void to_structure(RealModes& modes, Mat Z)
{
  for (Owned<Vec>& shape : modes.shapes)
  {
    Owned<Vec> whole;
    check(MatCreateVecs(Z, nullptr, whole.put()));
    check(MatMult(Z, shape, whole));
    shape = std::move(whole);
  }
}

} // namespace

double shift_below_zero(Mat M, Mat K)
{
  return -1e-8 * trace(K) / trace(M);
}

RealCount make_real_count(Mat M, Mat K, int dense_limit)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  if (n <= dense_limit)
  {
    const SymmetricEigenpairs all = solve_whole(M, K);
    return {{}, {all.lambda.begin(), all.lambda.end()}, {}};
  }
  return {make_shift_invert(K, M, Symmetry::symmetric), {}, {{0, 0}}};
}

int count_below(RealCount& count, double omega)
{
  if (!count.pencil.K)
    return static_cast<int>(std::lower_bound(count.all.begin(), count.all.end(), omega * omega) - count.all.begin());
  const auto [known, is_new] = count.below.try_emplace(omega);
  if (!is_new) return known->second;
  move_to(count.pencil, omega * omega);
  return known->second = count.pencil.factor->negative_pivots();
}

std::vector<double> omegas_between(RealCount& count, double least, double top)
{
  std::vector<double> omega;
  const auto take = [&](double theta)
  {
    if (theta >= least * least && theta < top * top) omega.push_back(std::sqrt(theta));
  };
  if (!count.pencil.K)
    std::for_each(count.all.begin(), count.all.end(), take);
  else
  {
    if (count.pencil.shift != top * top) move_to(count.pencil, top * top);
    const Nearest nearest = solve_nearest(count.pencil, 1, top * top - least * least, 1e-4);
    for (const std::complex<double> theta : nearest.theta) take(theta.real());
  }
  std::sort(omega.rbegin(), omega.rend());
  return omega;
}

RealModes solve_real_modes(Mat M, Mat K, int count, int dense_limit)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  if (count <= 0) return {{OutcomeKind::converged, "", 0, 0}, {}, {}};
  if (n <= dense_limit) return first_of(solve_whole(M, K), K, count);
  const Goal goal{HUGE_VAL, static_cast<int>(std::min<PetscInt>(count, n))};
  return to_modes(sweep(M, K, goal), M, K, goal.count);
}

RealModes solve_real_modes_below(Mat M, Mat K, double band, int dense_limit)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  const double omega = 2 * std::numbers::pi * band;
  if (n <= dense_limit)
  {
    const SymmetricEigenpairs all = solve_whole(M, K);
    const auto below = std::lower_bound(all.lambda.begin(), all.lambda.end(), omega * omega);
    return first_of(all, K, below - all.lambda.begin());
  }
  const Goal goal{omega * omega, to_int(n)};
  return to_modes(sweep(M, K, goal), M, K, goal.count);
}

RealModes find_real_modes_below(const LinearisedSliding& linearised, double band, const ModesOptions& options)
{
  RealModes modes = solve_real_modes_below(linearised.M_z, linearised.K_z, band, static_cast<int>(options.dense_limit));
  to_structure(modes, linearised.contact.Z);
  return modes;
}

} // namespace squeal
