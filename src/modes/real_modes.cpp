#include "squeal/modes/real_modes.hpp"

#include "squeal/algebra/multivector.hpp"
#include "squeal/equilibrium/closed_contact.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

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

struct DenseModes
{
  std::vector<double> lambda, y;
};

// On rank 0, told to all.
DenseModes solve_dense_shared(MPI_Comm comm, int n, const std::vector<double>& M, const std::vector<double>& K,
                              double shift)
{
  DenseModes modes;
  on_rank_zero(comm, [&] { solve_dense_symmetric(n, M, K, shift, modes.lambda, modes.y); });
  int count = static_cast<int>(modes.lambda.size());
  MPI_Bcast(&count, 1, MPI_INT, 0, comm);
  modes.lambda.resize(static_cast<std::size_t>(count));
  modes.y.resize(static_cast<std::size_t>(count) * static_cast<std::size_t>(n));
  MPI_Bcast(modes.lambda.data(), count, MPI_DOUBLE, 0, comm);
  MPI_Bcast(modes.y.data(), static_cast<int>(modes.y.size()), MPI_DOUBLE, 0, comm);
  return modes;
}

DenseModes solve_whole(Mat M, Mat K)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  return solve_dense_shared(comm_of(K), static_cast<int>(n), dense_copy(M), dense_copy(K), shift_below_zero(M, K));
}

RealModes first_of(const DenseModes& all, Mat K, int count)
{
  PetscInt n = 0, first = 0, last = 0;
  check(MatGetSize(K, &n, nullptr));
  check(MatGetOwnershipRange(K, &first, &last));
  RealModes modes;
  const int given = std::min(count, static_cast<int>(all.lambda.size()));
  modes.outcome = {OutcomeKind::converged, "", 1, 0};
  for (int k = 0; k < given; ++k)
  {
    Owned<Vec> shape;
    check(MatCreateVecs(K, shape.put(), nullptr));
    for (PetscInt i = first; i < last; ++i)
      check(VecSetValue(shape, i, all.y[static_cast<std::size_t>(k * n + i)], INSERT_VALUES));
    check(VecAssemblyBegin(shape));
    check(VecAssemblyEnd(shape));
    modes.omega.push_back(std::sqrt(std::max(0.0, all.lambda[static_cast<std::size_t>(k)])));
    modes.shapes.push_back(std::move(shape));
  }
  return modes;
}

// What a sweep looks for: all theta = omega^2 below a limit, or the first few.
struct Sought
{
  double limit = 0; // [1/s2]
  int count = 0;
};

struct Found
{
  std::vector<double> theta;
  Block shapes;
  double covered = -INFINITY; // every theta below is here
  bool complete = false;      // by count
  int iterations = 0;

  int count() const { return static_cast<int>(theta.size()); }
  int below(double limit) const
  {
    return static_cast<int>(std::lower_bound(theta.begin(), theta.end(), limit) - theta.begin());
  }
};

// Between the last third of the ascending values, the middle of the widest gap: a cluster is not cut there.
double widest_gap(const std::vector<double>& values)
{
  std::size_t best = values.size() - 1;
  for (std::size_t k = best; 3 * k >= 2 * values.size() && k > 0; --k)
    if (values[k] - values[k - 1] > values[best] - values[best - 1]) best = k;
  return (values[best] + values[best - 1]) / 2;
}

// theta and M-normalised shapes of the symmetric problem on an invariant subspace
DenseModes ritz_modes(const Nearest& nearest, Mat M, Mat K)
{
  const Block& space = nearest.space;
  double largest = 0;
  for (const std::complex<double> theta : nearest.theta) largest = std::max(largest, std::abs(theta));
  return solve_dense_shared(space.comm, static_cast<int>(space.columns), inner(space, product(M, space)),
                            inner(space, product(K, space)), -largest);
}

// Takes over what lies between found.covered and a gap before `end`.
void take(Found& found, const DenseModes& ritz, const Block& space, double end, const Sought& sought)
{
  std::vector<double> values = {found.covered};
  for (const double theta : ritz.lambda)
    if (theta > found.covered && theta < end) values.push_back(theta);
  values.push_back(end);
  found.covered = end >= sought.limit ? sought.limit : widest_gap(values);
  std::vector<double> chosen;
  PetscInt count = 0;
  for (std::size_t k = 0; k < ritz.lambda.size(); ++k)
  {
    if (ritz.lambda[k] <= values.front() || ritz.lambda[k] >= found.covered) continue;
    const auto column = ritz.y.begin() + static_cast<std::ptrdiff_t>(k) * space.columns;
    chosen.insert(chosen.end(), column, column + space.columns);
    found.theta.push_back(ritz.lambda[k]);
    ++count;
  }
  append(found.shapes, combination(space, chosen, count));
}

// The largest |K x - theta M x| / (|K| |x|)
double largest_residual(const Found& found, Mat M, Mat K)
{
  Block residual = product(K, found.shapes), inertia = product(M, found.shapes);
  for (PetscInt k = 0; k < residual.columns; ++k)
    for (PetscInt i = 0; i < residual.rows; ++i)
      residual.column(k)[i] -= found.theta[static_cast<std::size_t>(k)] * inertia.column(k)[i];
  double stiffness = 0, largest = 0;
  check(MatNorm(K, NORM_1, &stiffness));
  const std::vector<double> left = column_norms(residual), size = column_norms(found.shapes);
  for (std::size_t k = 0; k < left.size(); ++k) largest = std::max(largest, left[k] / (stiffness * size[k]));
  return largest;
}

constexpr int ahead = 20, above = 40; // values from what is found to the next shift, and beyond it

// Moves up until about `ahead` values lie between what is found and the shift; returns how many do.
int climb(ShiftInvert& pencil, const Found& found, double step, double limit)
{
  int between = 0;
  for (int attempt = 0; attempt < 6; ++attempt)
  {
    const double shift = std::min(found.covered + step, limit);
    move_to(pencil, shift);
    between = pencil.factor->negative_pivots() - found.count();
    if (between <= ahead + ahead / 4 && (2 * between >= ahead || shift == limit)) break;
    step = (shift - found.covered) * std::min(3.0, ahead / std::max(1.0, static_cast<double>(between)));
  }
  return between;
}

// Forgets what no count has confirmed.
void fall_back(Found& found, double verified)
{
  const int kept = found.below(verified);
  found.theta.resize(static_cast<std::size_t>(kept));
  found.shapes.columns = static_cast<PetscInt>(kept);
  found.shapes.entries.resize(static_cast<std::size_t>(kept) * static_cast<std::size_t>(found.shapes.rows));
  found.covered = verified;
}

// What lies around the shift joins `found` if it is all there, by the shift's count of what lies below it.
bool advance(Found& found, const ShiftInvert& pencil, PetscInt count, int between, const Sought& sought)
{
  const Nearest nearest = solve_nearest(pencil, count, pencil.shift - found.covered, 1e-9);
  ++found.iterations;
  if (!nearest.converged) return false;
  const DenseModes ritz = ritz_modes(nearest, pencil.M, pencil.K);
  const auto below = std::count_if(ritz.lambda.begin(), ritz.lambda.end(),
                                   [&](double theta) { return theta > found.covered && theta < pencil.shift; });
  if (below != between) return false;
  take(found, ritz, nearest.space, pencil.shift + nearest.reach, sought);
  return true;
}

// Shifts climb through the spectrum; the factor at each says how many values lie below it, and all must be there.
Found sweep(Mat M, Mat K, const Sought& sought)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  ShiftInvert pencil = make_shift_invert(K, M, Symmetry::symmetric);
  Found found;
  found.shapes = empty_block(K);
  double verified = shift_below_zero(M, K); // all below is found for sure
  found.covered = verified;
  move_to(pencil, verified);
  for (int failures = 0, between = 0; failures < 4 && !found.complete;)
  {
    const int missing = std::clamp(sought.count - found.count() - between + 2, 5, above);
    const double start = std::max(0.0, found.covered);
    const int before = found.count();
    const bool good =
        advance(found, pencil, std::min<PetscInt>(n, between + missing * (1 + failures)), between, sought);
    if (good && std::isinf(found.covered)) found.complete = true; // the whole spectrum
    if (found.complete) break;
    failures = good ? 0 : failures + 1;
    if (good) verified = pencil.shift;
    if (good && found.covered < sought.limit && found.count() < sought.count)
    {
      const double spacing = (found.covered - start) / std::max(1, found.count() - before);
      between = climb(pencil, found, ahead * spacing, sought.limit);
      continue;
    }
    // Done if the count says so; or what is missing lies below, and nearer shifts find it.
    if (good) move_to(pencil, found.covered);
    found.complete = good && pencil.factor->negative_pivots() == found.below(pencil.shift);
    if (found.complete) break;
    fall_back(found, verified);
    if (!good) move_to(pencil, (verified + pencil.shift) / 2);
    between = pencil.factor->negative_pivots() - found.count();
  }
  return found;
}

RealModes to_modes(const Found& found, Mat M, Mat K, const Sought& sought)
{
  RealModes modes;
  modes.outcome = {OutcomeKind::converged, "", found.iterations, largest_residual(found, M, K)};
  if (!found.complete)
  {
    modes.outcome.kind = OutcomeKind::not_converged;
    modes.outcome.reason = std::to_string(found.count()) + " real modes found, and more are missing";
  }
  for (int k = 0; k < std::min(found.count(), sought.count); ++k)
  {
    Owned<Vec> shape;
    check(MatCreateVecs(K, shape.put(), nullptr));
    copy_column(found.shapes, k, shape);
    modes.omega.push_back(std::sqrt(std::max(0.0, found.theta[static_cast<std::size_t>(k)])));
    modes.shapes.push_back(std::move(shape));
  }
  return modes;
}

struct BilateralProblem
{
  ClosedContact contact;
  Owned<Mat> M, K;
};

BilateralProblem make_bilateral(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium)
{
  BilateralProblem result;
  result.contact = eliminate_closed_pairs(structure, interface, equilibrium);
  result.M = project_symmetric(structure.M, result.contact.Z);
  result.K = project_symmetric(structure.K, result.contact.Z);
  return result;
}

void to_structure(RealModes& modes, const BilateralProblem& problem)
{
  for (Owned<Vec>& shape : modes.shapes)
  {
    Owned<Vec> whole;
    check(MatCreateVecs(problem.contact.Z, nullptr, whole.put()));
    check(MatMult(problem.contact.Z, shape, whole));
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
  if (n <= dense_limit) return {{}, solve_whole(M, K).lambda, {}};
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
  const Sought sought{INFINITY, std::min(count, static_cast<int>(n))};
  return to_modes(sweep(M, K, sought), M, K, sought);
}

RealModes solve_real_modes_below(Mat M, Mat K, double band, int dense_limit)
{
  PetscInt n = 0;
  check(MatGetSize(K, &n, nullptr));
  const double omega = 2 * std::numbers::pi * band;
  if (n <= dense_limit)
  {
    const DenseModes all = solve_whole(M, K);
    const auto below = std::lower_bound(all.lambda.begin(), all.lambda.end(), omega * omega);
    return first_of(all, K, static_cast<int>(below - all.lambda.begin()));
  }
  const Sought sought{omega * omega, static_cast<int>(n)};
  return to_modes(sweep(M, K, sought), M, K, sought);
}

int dense_limit_option()
{
  PetscInt limit = 400;
  check(PetscOptionsGetInt(nullptr, "modes_", "-dense_limit", &limit, nullptr));
  return static_cast<int>(limit);
}

RealModes find_real_modes_below(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                                double band)
{
  const BilateralProblem problem = make_bilateral(structure, interface, equilibrium);
  RealModes modes = solve_real_modes_below(problem.M, problem.K, band, dense_limit_option());
  to_structure(modes, problem);
  return modes;
}

} // namespace squeal
