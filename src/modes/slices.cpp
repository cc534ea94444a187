#include "squeal/modes/slices.hpp"

#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/projection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace squeal
{

namespace
{

constexpr int per_slice = 100;           // pairs, at most
constexpr double beyond = 1.05;          // of the band, for the count
constexpr double usual = .06, wide = .2; // [rad] by which friction may turn theta: twice the change of damping ratio
constexpr int passes = 12;               // of residual correction, if not all pairs are exact before
constexpr double invariant = 1e-9;       // V, to be exact
constexpr double enough = 1e-12, sharp = 1e-14; // backward errors,
constexpr double spurious = 1e-8;               // and that of what is no pair
constexpr double suspect = 1e-6;                // theta so small, in parts of the largest, may be a free body's
constexpr double share = 1e-2;                  // a pass divides residuals by ten or so: a fourth of all directions
constexpr double two_pi = 2 * std::numbers::pi;

// lower <= |lambda| < upper [rad/s]
struct Slice
{
  double lower = 0, upper = 0;
  int expected = 0;
  double slowest = INFINITY; // |theta|
  std::vector<Eigenpair> pairs;
};

// Halves [0, reach] until a slice holds few enough of the real modes.
std::vector<Slice> plan(RealCount& real, double floor, double reach)
{
  std::vector<double> edges = {reach, 0}; // those still to come, descending
  std::vector<Slice> slices;
  while (edges.size() > 1)
  {
    const double lower = edges.back(), upper = edges[edges.size() - 2];
    const int expected = count_below(real, upper) - count_below(real, lower);
    if (expected > per_slice)
    {
      edges.insert(edges.end() - 1, (lower + upper) / 2);
      continue;
    }
    slices.push_back({std::max(lower, floor), upper, expected, INFINITY, {}});
    edges.pop_back();
  }
  return slices;
}

// If the Krylov space grows too large the slice stays as it is, and the count tells.
void find_pairs(Slice& slice, const QuadraticProblem& problem, ShiftInvert& pencil, double turned)
{
  const double least = slice.lower * slice.lower, limit = slice.upper * slice.upper, middle = (least + limit) / 2;
  move_to(pencil, middle);
  const double radius = std::abs(std::polar(limit, turned) - pencil.shift);
  const Nearest nearest = solve_nearest(pencil, slice.expected, radius, invariant);
  if (!nearest.converged) return;
  for (const std::complex<double> theta : nearest.theta) slice.slowest = std::min(slice.slowest, std::abs(theta));
  const Correction correction{{least, limit}, passes, std::numeric_limits<int>::max(), enough, sharp, share};
  slice.pairs = solve_on_subspace(problem, nearest.space, *pencil.factor, correction).pairs;
  std::erase_if(slice.pairs, [](const Eigenpair& pair) { return pair.backward_error > spurious; });
}

QuadraticSolution joined(std::vector<Slice>& slices)
{
  QuadraticSolution solution;
  solution.outcome = {OutcomeKind::converged, "", static_cast<int>(slices.size()), 0};
  for (Slice& slice : slices)
    for (const Eigenpair& pair : slice.pairs)
      solution.pairs.push_back({pair.lambda, copy_of(pair.real), copy_of(pair.imaginary), pair.backward_error});
  settle(solution);
  return solution;
}

} // namespace

PairCount count_pairs(const QuadraticSolution& solution, RealCount& real, int free, double least, double top)
{
  std::vector<double> sizes;
  for (const Eigenpair& pair : solution.pairs) sizes.push_back(std::abs(pair.lambda));
  std::sort(sizes.rbegin(), sizes.rend());
  const auto from = [](double edge, const std::vector<double>& values) {
    return static_cast<int>(std::count_if(values.begin(), values.end(), [&](double value) { return value >= edge; }));
  };
  const int all = static_cast<int>(sizes.size());
  const PairCount whole{top / two_pi, count_below(real, top) - free, all - from(top, sizes)};
  if (whole.expected == whole.found) return whole;
  const std::vector<double> omega = omegas_between(real, least, top);
  for (std::size_t k = 1; k < sizes.size() && sizes[k - 1] > least; ++k)
  {
    const double edge = std::max(least, (sizes[k - 1] + sizes[k]) / 2);
    if (edge >= top) continue;
    const PairCount count{edge / two_pi, whole.expected - from(edge, omega), all - from(edge, sizes)};
    if (count.expected == count.found) return count;
  }
  return whole;
}

CountedSolution solve_by_slices(const QuadraticProblem& problem, RealCount& real, double band)
{
  const double floor = std::sqrt(vibration_floor(norms_of(problem))), end = two_pi * band, reach = beyond * end;
  std::vector<Slice> slices = plan(real, floor, reach);
  ShiftInvert pencil = make_shift_invert(problem.K, problem.M, Symmetry::none);
  CountedSolution result;
  const auto search = [&](double turned)
  {
    bool slow = false;
    for (Slice& slice : slices)
    {
      if (turned == usual || static_cast<int>(slice.pairs.size()) < slice.expected)
        find_pairs(slice, problem, pencil, turned);
      slow = slow || slice.slowest < suspect * reach * reach;
    }
    result.solution = joined(slices);
    result.count = count_pairs(result.solution, real, slow ? count_below(real, floor) : 0, end, reach);
  };
  search(usual);
  // Friction moved some far. Between neighbours pairs may have changed places: only the sum is sure.
  if (result.count.found < result.count.expected) search(wide);
  return result;
}

} // namespace squeal
