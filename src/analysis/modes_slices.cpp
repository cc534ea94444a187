#include "squeal/analysis/slices.hpp"

#include "squeal/analysis/projection.hpp"
#include "squeal/analysis/shift_invert.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;

constexpr int per_slice = 20;      // pairs
constexpr int passes = 10;         // of correction, the first included
constexpr double refined = 1e-13;  // backward error to which pairs are corrected,
constexpr double accepted = 1e-10; // and below which a pair is one, not a shadow of those outside the slice
constexpr double two_pi = 2 * std::numbers::pi;

int count_below(const std::vector<double>& ascending, double omega)
{
  return static_cast<int>(std::lower_bound(ascending.begin(), ascending.end(), omega) - ascending.begin());
}

// Of the gaps between omega[first] and omega[last], ends included, the middle of the widest.
double widest_gap(const std::vector<double>& omega, int first, int last)
{
  int best = first;
  const auto at = [&](int k) { return omega[static_cast<std::size_t>(k)]; };
  for (int k = first; k < last; ++k)
    if (at(k + 1) - at(k) > at(best + 1) - at(best)) best = k;
  return (at(best) + at(best + 1)) / 2;
}

// Edges [rad/s] of slices, in gaps between the real modes; smaller slices above the band, for the count.
std::vector<double> plan(const std::vector<double>& omega, double floor, double band, double reach)
{
  std::vector<double> edges = {floor};
  const int last = static_cast<int>(omega.size()) - 1;
  for (int first = count_below(omega, floor); edges.back() < reach; first = count_below(omega, edges.back()))
  {
    const int inside = count_below(omega, band) - first, most = inside > 0 ? std::min(per_slice, inside + 2) : 5;
    if (first + most + 6 >= last)
      edges.push_back(reach);
    else
      edges.push_back(widest_gap(omega, first + most - most / 4, first + most + 6));
  }
  return edges;
}

// V and A^-1 M V, A^-1 C V with A = K - theta_0 M: Q(lambda) is projected as V'A^-1 Q(lambda) V, in which modes far
// from theta_0 are nearly the identity and throw no shadows into the slice, as they do in V'Q V.
struct SliceSpace
{
  Block V, MV, CV;
  std::vector<double> M, C; // V'A^-1 M V, V'A^-1 C V
};

// The rows and columns that the last columns of V add to V'S.
void border(std::vector<double>& projected, const Block& V, const Block& S, PetscInt before)
{
  const std::vector<double> right = inner(V, columns_from(S, before));
  Block old = S;
  old.columns = before;
  const std::vector<double> below = inner(columns_from(V, before), old);
  const auto size = static_cast<std::size_t>(V.columns), kept = static_cast<std::size_t>(before), fresh = size - kept;
  std::vector<double> entries(size * size);
  for (std::size_t j = 0; j < kept; ++j)
  {
    std::copy_n(projected.begin() + static_cast<std::ptrdiff_t>(j * kept), kept,
                entries.begin() + static_cast<std::ptrdiff_t>(j * size));
    std::copy_n(below.begin() + static_cast<std::ptrdiff_t>(j * fresh), fresh,
                entries.begin() + static_cast<std::ptrdiff_t>(j * size + kept));
  }
  std::copy(right.begin(), right.end(), entries.begin() + static_cast<std::ptrdiff_t>(kept * size));
  projected = std::move(entries);
}

bool extend(SliceSpace& space, const QuadraticProblem& problem, const ShiftInvert& pencil, Block X)
{
  const PetscInt before = space.V.columns;
  if (extend_orthonormal(space.V, std::move(X)) == 0) return false;
  const Block W = columns_from(space.V, before);
  append(space.MV, solved(pencil.factor, product(problem.M, W)));
  append(space.CV, solved(pencil.factor, product(problem.C, W)));
  border(space.M, space.V, space.MV, before);
  border(space.C, space.V, space.CV, before);
  return true;
}

std::vector<DenseEigenpair> solve_on(const SliceSpace& space, double shift, const Window& window)
{
  std::vector<double> K(space.M.size()); // V'A^-1 K V
  const auto size = static_cast<std::size_t>(space.V.columns);
  for (std::size_t i = 0; i < K.size(); ++i) K[i] = shift * space.M[i] + (i % (size + 1) == 0 ? 1 : 0);
  std::vector<DenseEigenpair> found =
      solve_dense_quadratic_shared(space.V.comm, static_cast<int>(size), space.M, space.C, K);
  std::erase_if(found, [&](const DenseEigenpair& pair) { return !window.holds(pair.lambda); });
  return found;
}

// Of the pairs that are surely some, 1e-6, or at least as many as are expected, the largest backward error: what the
// slice casts of modes outside it is worse.
double largest_of_good(const std::vector<Eigenpair>& pairs, int expected)
{
  std::vector<double> errors;
  for (const Eigenpair& pair : pairs) errors.push_back(pair.backward_error);
  std::sort(errors.begin(), errors.end());
  const std::size_t least = std::min(errors.size(), static_cast<std::size_t>(expected) + 3);
  return errors.empty() ? 0 : std::max(1e-6, errors[least - 1]);
}

// A^-1 Q(lambda) y, but for its part in V, of the pairs that are not good enough.
Block corrections(const SliceSpace& space, double shift, int expected, const std::vector<DenseEigenpair>& found,
                  const std::vector<Eigenpair>& pairs)
{
  const double worst = largest_of_good(pairs, expected);
  std::vector<double> on_MV, on_CV;
  PetscInt count = 0;
  for (std::size_t k = 0; k < found.size(); ++k)
  {
    if (pairs[k].backward_error <= refined || pairs[k].backward_error > worst) continue;
    const std::complex<double> lambda = found[k].lambda, square = lambda * lambda + shift;
    for (const Complex turn : {Complex(1, 0), Complex(0, -1)}) // real parts, then imaginary ones
    {
      for (const std::complex<double>& a : found[k].y)
      {
        on_MV.push_back((turn * square * a).real());
        on_CV.push_back((turn * lambda * a).real());
      }
      ++count;
    }
  }
  Block X = combination(space.MV, on_MV, count);
  add_combination(X, 1, space.CV, on_CV);
  return X;
}

// A slice of the band, the undamped modes in and around it, and the factor at its middle.
struct Slice
{
  double lower = 0, upper = 0; // [rad/s]
  int expected = 0;
  ShiftInvert pencil;
  Block undamped;

  Window window() const { return {lower * lower, upper * upper}; }
};

Slice make_slice(const QuadraticProblem& problem)
{
  Slice slice;
  slice.pencil = make_shift_invert(problem.K, problem.M, Symmetry::general);
  return slice;
}

void set_window(Slice& slice, const std::vector<double>& omega, double lower, double upper)
{
  slice.lower = lower;
  slice.upper = upper;
  slice.expected = count_below(omega, upper) - count_below(omega, lower);
}

// If the Krylov space grows too large the slice is left with its neighbours' modes, and the count tells.
void find_undamped(Slice& slice)
{
  const Window window = slice.window();
  move_to(slice.pencil, (window.least + window.limit) / 2);
  Nearest nearest = solve_nearest(slice.pencil, slice.expected + 4, 1.02 * (window.limit - window.least) / 2);
  slice.undamped = std::move(nearest.space);
}

// The pairs of a slice, from its undamped modes and those of its neighbours.
std::vector<Eigenpair> find_damped(const QuadraticProblem& problem, const Slice& slice, const Block& neighbours)
{
  const double shift = slice.pencil.shift;
  SliceSpace space{empty_block(problem.K), empty_block(problem.K), empty_block(problem.K), {}, {}};
  Block fresh = slice.undamped;
  append(fresh, neighbours);
  std::vector<Eigenpair> pairs;
  for (int pass = 0; pass < passes && extend(space, problem, slice.pencil, std::move(fresh)); ++pass)
  {
    const std::vector<DenseEigenpair> found = solve_on(space, shift, slice.window());
    pairs = eigenpairs(problem, space.V, found);
    fresh = corrections(space, shift, slice.expected, found, pairs);
  }
  std::erase_if(pairs, [](const Eigenpair& pair) { return pair.backward_error > accepted; });
  return pairs;
}

PairCount count_pairs(const QuadraticSolution& solution, const std::vector<double>& omega, double floor, double edge)
{
  PairCount count{edge / two_pi, count_below(omega, edge) - count_below(omega, floor), 0};
  for (const Eigenpair& pair : solution.pairs) count.found += std::abs(pair.lambda) < edge;
  return count;
}

} // namespace

CountedSolution solve_by_slices(const QuadraticProblem& problem, const std::vector<double>& omega, double band,
                                double reach)
{
  CountedSolution result;
  QuadraticSolution& solution = result.solution;
  solution.outcome = {"converged", "", 0, 0};
  const double floor = std::sqrt(vibration_floor(norms_of(problem)));
  const std::vector<double> edges = plan(omega, floor, two_pi * band, two_pi * reach);
  Slice slice = make_slice(problem), next = make_slice(problem);
  Block below = empty_block(problem.K);
  set_window(slice, omega, edges[0], edges[1]);
  find_undamped(slice);
  for (std::size_t k = 1; k < edges.size(); ++k)
  {
    next.undamped = empty_block(problem.K);
    if (k + 1 < edges.size())
    {
      set_window(next, omega, edges[k], edges[k + 1]);
      find_undamped(next);
    }
    append(below, next.undamped); // both neighbours
    for (Eigenpair& pair : find_damped(problem, slice, below)) solution.pairs.push_back(std::move(pair));
    ++solution.outcome.iterations;
    result.count = count_pairs(solution, omega, floor, slice.upper);
    if (slice.upper >= two_pi * band && result.count.expected == result.count.found) break;
    below = std::move(slice.undamped);
    std::swap(slice, next);
  }
  for (const Eigenpair& pair : solution.pairs)
    solution.outcome.residual = std::max(solution.outcome.residual, pair.backward_error);
  std::stable_sort(solution.pairs.begin(), solution.pairs.end(),
                   [](const Eigenpair& a, const Eigenpair& b) { return a.lambda.real() > b.lambda.real(); });
  return result;
}

Eigenpair solve_near(const QuadraticProblem& problem, std::complex<double> lambda, Block start)
{
  ShiftInvert pencil = make_shift_invert(problem.K, problem.M, Symmetry::general);
  move_to(pencil, std::norm(lambda));
  SliceSpace space{empty_block(problem.K), empty_block(problem.K), empty_block(problem.K), {}, {}};
  Eigenpair best;
  best.backward_error = INFINITY;
  for (int pass = 0; pass < passes && extend(space, problem, pencil, std::move(start)); ++pass)
  {
    std::vector<DenseEigenpair> found = solve_on(space, pencil.shift, {0, INFINITY});
    const auto nearest = std::min_element(found.begin(), found.end(),
                                          [&](const DenseEigenpair& a, const DenseEigenpair& b)
                                          { return std::abs(a.lambda - lambda) < std::abs(b.lambda - lambda); });
    if (nearest == found.end()) break;
    found = {*nearest};
    std::vector<Eigenpair> pairs = eigenpairs(problem, space.V, found);
    start = corrections(space, pencil.shift, 1, found, pairs);
    best = std::move(pairs.front());
  }
  return best;
}

} // namespace squeal
