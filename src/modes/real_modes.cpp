#include "squeal/modes/real_modes.hpp"

#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/multivector.hpp"
#include "squeal/base/callback.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/integers.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>

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

/// Ascending theta = omega^2 and M-normalised shapes.
struct RealPairs
{
  Eigen::VectorXd theta{};
  MultiVector x;

  int number_below(double limit) const { return static_cast<int>((theta.array() < limit).count()); }
};

/// x = (K - shift M)^-1 b
using Solve = std::function<void(Vec b, Vec x)>;

/// What SLEPc calls for, and what a call threw.
struct Inverse
{
  const Solve& solve;
  std::exception_ptr failure{};
};

PetscErrorCode apply_inverse(PC preconditioner, Vec b, Vec x)
{
  Inverse* inverse = nullptr;
  PetscCall(PCShellGetContext(preconditioner, &inverse));
  return guarded(inverse->failure,
                 [&]
                 {
                   end_if_asked(comm_of(b));
                   inverse->solve(b, x);
                 });
}

/// A pencil with its inverse at a shift.
struct ShiftedPencil
{
  Mat K = nullptr, M = nullptr;
  double shift = 0;
  Solve solve{};
};

/// By the factor of the steps, which solves for one vector faster than MUMPS. Where K - shift M is not positive
/// definite, by MUMPS.
ShiftedPencil shifted_below_zero(Mat K, Mat M, double shift, const ModesOptions& options)
{
  const Owned<Mat> A = copy_of(K);
  check(MatAXPY(A, -shift, M, UNKNOWN_NONZERO_PATTERN));
  const auto factor = std::make_shared<const Factor>(A, nullptr, options.factor);
  if (!factor->failed()) return {K, M, shift, [factor](Vec b, Vec x) { solve(*factor, b, x); }};
  const auto pencil = std::make_shared<ShiftInvert>(make_shift_invert(K, M, Symmetry::symmetric, options.pencil));
  move_to(*pencil, shift);
  const auto solve = [pencil](Vec b, Vec x)
  { copy_column(pencil->factor->solve(columns_of(std::span<const Vec>(&b, 1))), 0, x); };
  return {K, M, pencil->shift, solve};
}

/// What SLEPc calls after each restart.
PetscErrorCode report_converged(EPS, PetscInt, PetscInt converged, PetscScalar*, PetscScalar*, PetscReal*, PetscInt,
                                void* progress)
{
  static_cast<Progress*>(progress)->update(static_cast<double>(converged),
                                           format("%d found", static_cast<int>(converged)));
  return PETSC_SUCCESS;
}

/// Krylov-Schur for the `count` theta nearest the pencil's shift.
Owned<EPS> make_solver(const ShiftedPencil& pencil, PetscInt count, Inverse& inverse)
{
  Owned<EPS> eps;
  ST transformation = nullptr;
  KSP solver = nullptr;
  PC factor = nullptr;
  check(EPSCreate(comm_of(pencil.K), eps.put()));
  check(EPSSetOperators(eps, pencil.K, pencil.M));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetType(eps, EPSKRYLOVSCHUR));
  check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  check(EPSSetTarget(eps, pencil.shift));
  check(EPSSetDimensions(eps, count, PETSC_DEFAULT, PETSC_DEFAULT));
  check(EPSSetTolerances(eps, 1e-9, 200));
  check(EPSGetST(eps, &transformation));
  check(STSetType(transformation, STSINVERT));
  check(STSetMatMode(transformation, ST_MATMODE_SHELL));
  check(STGetKSP(transformation, &solver));
  check(KSPSetType(solver, KSPPREONLY));
  check(KSPGetPC(solver, &factor));
  check(PCSetType(factor, PCSHELL));
  check(PCShellSetContext(factor, &inverse));
  check(PCShellSetApply(factor, apply_inverse));
  check(EPSSetOptionsPrefix(eps, "modes_real_"));
  check(EPSSetFromOptions(eps));
  return eps;
}

/// Adds to X, whose columns are M-orthonormal, the `count` eigenvectors nearest the pencil's shift that are
/// M-orthogonal to them. Returns the number of restarts.
int append_nearest(MultiVector& X, const ShiftedPencil& pencil, PetscInt count)
{
  Inverse inverse{pencil.solve};
  const Owned<EPS> eps = make_solver(pencil, count, inverse);
  const auto vector = [&](const MultiVector& columns, Index j)
  {
    Owned<Vec> x;
    check(MatCreateVecs(pencil.K, x.put(), nullptr));
    copy_column(columns, j, x);
    return x;
  };
  std::vector<Owned<Vec>> known;
  for (Index j = 0; j < X.columns(); ++j) known.push_back(vector(X, j));
  std::vector<Vec> borrowed(known.begin(), known.end());
  if (!known.empty()) check(EPSSetDeflationSpace(eps, static_cast<PetscInt>(known.size()), borrowed.data()));
  const Owned<Vec> start = vector(random_multivector(pencil.K, 1), 0), x = zeros_like(start);
  Vec initial = start;
  check(EPSSetInitialSpace(eps, 1, &initial));
  Progress progress(comm_of(pencil.K), "real modes", count);
  check(EPSMonitorSet(eps, report_converged, &progress, nullptr));
  check_after_callbacks(EPSSolve(eps), inverse.failure);
  PetscInt iterations = 0, converged = 0;
  check(EPSGetIterationNumber(eps, &iterations));
  check(EPSGetConverged(eps, &converged));
  for (PetscInt i = 0; i < converged; ++i)
  {
    check_after_callbacks(EPSGetEigenvector(eps, i, x, nullptr), inverse.failure); // it may apply the inverse
    append(X, x);
  }
  return static_cast<int>(iterations);
}

/// theta and shapes on the span of X. Beside the motions of a free body 1/(theta - shift) varies by 1e7, and SLEPc's
/// theta are off by that times the rounding. Here the dense problem is shifted by the mean theta instead.
RealPairs ritz_pairs(const MultiVector& X, Mat M, Mat K)
{
  if (X.columns() == 0) return {.x = X};
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
  double stiffness = 0;
  check(MatNorm(K, NORM_1, &stiffness));
  return (column_norms(residual).array() / column_norms(pairs.x).array()).maxCoeff() / stiffness;
}

/// A limit [1/s2] and the number of eigenvalues below it.
struct Inertia
{
  double limit = 0;
  int below = 0;
};

/// Counts at `limit`, or slightly lower where that is an eigenvalue.
Inertia inertia_at(double limit, ShiftInvert& pencil)
{
  move_to(pencil, limit);
  return {pencil.shift, pencil.factor->negative_pivots()};
}

Inertia inertia_at(double limit, Mat K, Mat M, const PencilOptions& options)
{
  ShiftInvert pencil = make_shift_invert(K, M, Symmetry::symmetric, options);
  return inertia_at(limit, pencil);
}

ShiftInvert& pencil_of(RealCount& count)
{
  if (!count.pencil.factor)
    count.pencil = make_shift_invert(count.K, count.M, Symmetry::symmetric, count.options, &order_of(count));
  return count.pencil;
}

/// The modes with theta < limit, at most `count` of them. One factor just below zero finds them, and one above the last
/// of them counts them. A space grown from one vector may miss copies of multiple modes; those are sought again.
RealModes search_from_below_zero(Mat M, Mat K, double limit, PetscInt count, const ModesOptions& options)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  const double shift = shift_below_zero(M, K);
  std::optional<Inertia> inertia;
  if (std::isfinite(limit)) inertia = inertia_at(limit, K, M, options.pencil);
  RealPairs found{.x = empty_multivector(K)};
  RealModes modes{{OutcomeKind::converged, "", 0, 0}, {}, {}};
  PetscInt missing = inertia ? inertia->below : count;
  if (missing == 0) return modes;
  const ShiftedPencil pencil = shifted_below_zero(K, M, shift, options);
  for (int attempt = 0; attempt < 6 && missing > 0 && found.x.columns() < n; ++attempt)
  {
    const PetscInt wanted = std::min<PetscInt>(n - found.x.columns(), missing + 1);
    modes.outcome.iterations += append_nearest(found.x, pencil, wanted);
    found = ritz_pairs(found.x, M, K);
    // The count is taken above the last mode by 1e-6 of its distance from the shift, far above the error of theta.
    if (!inertia && found.theta.size() >= count)
      inertia = inertia_at(found.theta[count - 1] + 1e-6 * (found.theta[count - 1] - shift), K, M, options.pencil);
    missing = inertia ? inertia->below - found.number_below(inertia->limit)
                      : count - static_cast<PetscInt>(found.theta.size());
  }
  modes.outcome.kind = missing == 0 ? OutcomeKind::converged : OutcomeKind::not_converged;
  if (missing != 0)
    modes.outcome.reason = std::to_string(found.theta.size()) + " real modes found, and the inertia says that " +
                           std::to_string(missing) + " are missing";
  const Index kept = std::min<Index>(count, found.number_below(limit));
  found = {found.theta.head(kept), {found.x.comm, found.x.entries.leftCols(kept)}};
  modes.outcome.residual = largest_residual(found, M, K);
  for (Index k = 0; k < kept; ++k)
  {
    modes.omega.push_back(std::sqrt(std::max(0.0, found.theta[k])));
    check(MatCreateVecs(K, modes.shapes.emplace_back().put(), nullptr));
    copy_column(found.x, k, modes.shapes.back());
  }
  return modes;
}

/// The modes with low <= theta < high, found from the middle, about `expected` of them. Where they are too many for one
/// space, by halves.
void append_between(double low, double high, int expected, ShiftInvert& pencil, RealModes& modes)
{
  const double middle = (low + high) / 2;
  move_to(pencil, middle);
  const double radius = (high - low) / 2 + std::abs(pencil.shift - middle);
  const Nearest nearest = solve_nearest(pencil, std::max(expected, 1), radius, 1e-4);
  if (!nearest.converged)
  {
    append_between(middle, high, expected / 2, pencil, modes);
    append_between(low, middle, expected / 2, pencil, modes);
    return;
  }
  const RealPairs found = ritz_pairs(nearest.space, pencil.M, pencil.K);
  for (Index k = 0; k < found.theta.size(); ++k)
  {
    if (!(found.theta[k] >= low && found.theta[k] < high)) continue;
    modes.omega.push_back(std::sqrt(std::max(0.0, found.theta[k])));
    check(MatCreateVecs(pencil.K, modes.shapes.emplace_back().put(), nullptr));
    copy_column(found.x, k, modes.shapes.back());
  }
}

/// The modes with low <= theta < high. No count by inertia assures them: a basis can do without one that is missed.
RealModes search_between(Mat M, Mat K, double low, double high, const PencilOptions& options)
{
  ShiftInvert pencil = make_shift_invert(K, M, Symmetry::symmetric, options);
  RealModes modes{{OutcomeKind::converged, "", 0, 0}, {}, {}};
  append_between(low, high, 1, pencil, modes);
  return modes;
}

/// Slices of equal width in frequency, so many that one holds about `slice` modes: the work of a slice grows by the
/// square of their number.
RealModes search_in_slices(Mat M, Mat K, double omega, const PencilOptions& options)
{
  constexpr int slice = 150;
  ShiftInvert pencil = make_shift_invert(K, M, Symmetry::symmetric, options);
  const Inertia end = inertia_at(omega * omega, pencil);
  const int slices = std::max(1, (end.below + slice - 1) / slice);
  RealModes modes{{OutcomeKind::converged, "", 0, 0}, {}, {}};
  for (int k = slices; k > 0; --k)
  {
    const double low = k == 1 ? shift_below_zero(M, K) : end.limit * std::pow((k - 1.) / slices, 2);
    append_between(low, end.limit * std::pow(1. * k / slices, 2), end.below / slices, pencil, modes);
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

RealCount make_real_count(Mat M, Mat K, const ModesOptions& options)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  RealCount count{.K = K, .M = M, .options = options.pencil};
  count.below[0] = 0;
  if (n > options.dense_limit) return count;
  const SymmetricEigenpairs all = solve_whole(M, K);
  count.all.assign(all.lambda.begin(), all.lambda.end());
  return count;
}

int count_below(RealCount& count, double omega)
{
  if (!count.all.empty())
    return static_cast<int>(std::lower_bound(count.all.begin(), count.all.end(), omega * omega) - count.all.begin());
  const auto [known, is_new] = count.below.try_emplace(omega);
  if (!is_new) return known->second;
  return known->second = inertia_at(omega * omega, pencil_of(count)).below;
}

const EliminationOrder& order_of(RealCount& count)
{
  if (count.order.position.empty()) count.order = elimination_order(count.K);
  return count.order;
}

void free_factor(RealCount& count)
{
  count.pencil = {};
}

std::vector<double> omegas_between(RealCount& count, double least, double top)
{
  std::vector<double> omega;
  const auto take = [&](double theta)
  {
    if (theta >= least * least && theta < top * top) omega.push_back(std::sqrt(theta));
  };
  if (!count.all.empty())
    std::for_each(count.all.begin(), count.all.end(), take);
  else
  {
    ShiftInvert& pencil = pencil_of(count);
    if (pencil.shift != top * top) move_to(pencil, top * top);
    const Nearest nearest = solve_nearest(pencil, 1, top * top - least * least, 1e-4);
    for (const std::complex<double> theta : nearest.theta) take(theta.real());
  }
  std::sort(omega.rbegin(), omega.rend());
  return omega;
}

RealModes solve_real_modes(Mat M, Mat K, PetscInt count, const ModesOptions& options)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  if (count <= 0) return {{OutcomeKind::converged, "", 0, 0}, {}, {}};
  if (n <= options.dense_limit) return first_of(solve_whole(M, K), K, count);
  return search_from_below_zero(M, K, HUGE_VAL, std::min(count, n), options);
}

RealModes solve_real_modes_below(Mat M, Mat K, double band, const ModesOptions& options)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  const double omega = two_pi * band;
  if (n <= options.dense_limit)
  {
    const SymmetricEigenpairs all = solve_whole(M, K);
    const auto below = std::lower_bound(all.lambda.begin(), all.lambda.end(), omega * omega);
    return first_of(all, K, below - all.lambda.begin());
  }
  return search_from_below_zero(M, K, omega * omega, to_int(n), options);
}

RealModes solve_most_real_modes_below(Mat M, Mat K, double band, const ModesOptions& options)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  if (n <= options.dense_limit) return solve_real_modes_below(M, K, band, options);
  return search_in_slices(M, K, two_pi * band, options.pencil);
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
  PetscInt n = 0;
  check(MatGetSize(linearised.K_z, &n, nullptr));
  if (!(low < high)) return {{OutcomeKind::converged, "", 0, 0}, {}, {}};
  if (low <= 0 || n <= options.dense_limit) return find_real_modes_below(linearised, high, options);
  const auto theta = [](double frequency_hz) { return std::pow(two_pi * frequency_hz, 2); };
  RealModes modes = search_between(linearised.M_z, linearised.K_z, theta(low), theta(high), options.pencil);
  to_structure(modes, linearised.contact.Z);
  return modes;
}

} // namespace squeal
