#include "squeal/modes/slices.hpp"

#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/modes/projection.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace squeal
{

namespace
{

constexpr int most_in_slice = 100;      // pairs
constexpr double narrowest = 1e-3;      // slice, over its upper end: nearer modes are not parted
constexpr double reach_of_count = 1.05; // over the band
// The angle by which friction turns theta [rad], twice the change of the damping ratio: of most pairs, and of those
// that a second search includes.
constexpr double usual_angle = 0.06, wide_angle = 0.2;
constexpr int slice_passes = 16;                        // of residual correction, at most
constexpr double subspace_tolerance = 1e-9;             // for V to be invariant
constexpr double pair_tolerance = 1e-12, sharp = 1e-14; // backward errors of pairs, and of nearly critical ones
// Vectors beside a slice's own, by their number. Without them what its ends are corrected by has most of its
// neighbours.
constexpr double guards = 0.3;
constexpr double spurious_pair = 1e-8;  // backward error of what is no pair
constexpr double rigid_share = 1e-6;    // theta below this part of the largest may be a free body's
constexpr double residual_share = 1e-2; // a pass divides residuals by about ten: a quarter of them stay

/// The pairs with lower <= |lambda| < upper [rad/s].
struct Slice
{
  double lower = 0, upper = 0;
  int expected = 0;           // real modes in it
  double smallest = HUGE_VAL; // |theta|
  std::vector<Eigenpair> pairs{};
};

/// Halves [0, reach] until each slice holds few enough real modes.
std::vector<Slice> make_slices(RealCount& real, double floor, double reach)
{
  std::vector<double> edges = {reach, 0}; // those still to come, descending
  std::vector<Slice> slices;
  while (edges.size() > 1)
  {
    const double lower = edges.back(), upper = edges[edges.size() - 2];
    const int expected = count_below(real, upper) - count_below(real, lower);
    if (expected > most_in_slice && upper > floor && upper - lower > narrowest * upper)
    {
      edges.insert(edges.end() - 1, (lower + upper) / 2);
      continue;
    }
    slices.push_back({.lower = std::max(lower, floor), .upper = upper, .expected = expected});
    edges.pop_back();
  }
  return slices;
}

/// Finds the pairs of a slice among those that friction turns by at most `angle`. Leaves the slice as it is if the
/// Krylov space grows too large; the count then shows that pairs are missing.
void find_pairs(Slice& slice, const QuadraticProblem& problem, ShiftInvert& pencil, double angle)
{
  const double least = slice.lower * slice.lower, limit = slice.upper * slice.upper, middle = (least + limit) / 2;
  move_to(pencil, middle);
  const double radius = std::abs(std::polar(limit, angle) - pencil.shift);
  Nearest nearest = solve_nearest(pencil, slice.expected, radius, subspace_tolerance, guards);
  if (!nearest.converged) return;
  for (const std::complex<double> theta : nearest.theta) slice.smallest = std::min(slice.smallest, std::abs(theta));
  const Correction correction{{least, limit}, slice_passes, std::numeric_limits<int>::max(),
                              pair_tolerance, sharp,        residual_share};
  slice.pairs = solve_on_subspace(problem, nullptr, std::move(nearest.space), *pencil.factor, correction).pairs;
  std::erase_if(slice.pairs, [](const Eigenpair& pair) { return pair.backward_error > spurious_pair; });
}

QuadraticSolution join(std::vector<Slice> slices)
{
  QuadraticSolution solution;
  solution.outcome = {OutcomeKind::converged, "", static_cast<int>(slices.size()), 0};
  for (Slice& slice : slices) std::ranges::move(slice.pairs, std::back_inserter(solution.pairs));
  sort_and_measure(solution);
  return solution;
}

} // namespace

PairCount count_pairs(std::vector<double> moduli, RealCount& real, int free, double least, double top)
{
  std::sort(moduli.rbegin(), moduli.rend());
  const auto number_from = [](double edge, const std::vector<double>& values) {
    return static_cast<int>(std::count_if(values.begin(), values.end(), [&](double value) { return value >= edge; }));
  };
  const int all = static_cast<int>(moduli.size());
  const PairCount whole{top / two_pi, count_below(real, top) - free, all - number_from(top, moduli)};
  if (whole.expected == whole.found) return whole;
  const std::vector<double> omega = omegas_between(real, least, top);
  for (std::size_t k = 1; k < moduli.size() && moduli[k - 1] > least; ++k)
  {
    const double edge = std::max(least, (moduli[k - 1] + moduli[k]) / 2);
    if (edge >= top) continue;
    const PairCount count{edge / two_pi, whole.expected - number_from(edge, omega), all - number_from(edge, moduli)};
    if (count.expected == count.found) return count;
  }
  return whole;
}

CountedSolution solve_by_slices(const QuadraticProblem& problem, RealCount& real, double band,
                                const PencilOptions& options)
{
  const double floor = std::sqrt(vibration_floor(norms_of(problem))), end = two_pi * band, reach = reach_of_count * end;
  std::vector<Slice> slices = make_slices(real, floor, reach);
  const int all = count_below(real, reach);
  free_factor(real); // all counts that a complete search needs are known
  CountedSolution result;
  const auto search = [&](bool again)
  {
    Progress progress(comm_of(problem.K), again ? "modes again" : "modes", all);
    ShiftInvert pencil = make_shift_invert(problem.K, problem.M, Symmetry::none, options, &order_of(real));
    bool rigid = false; // a body may be free
    std::vector<double> moduli;
    for (Slice& slice : slices)
    {
      if (!again || static_cast<int>(slice.pairs.size()) < slice.expected)
        find_pairs(slice, problem, pencil, again ? wide_angle : usual_angle);
      progress.update(count_below(real, slice.upper), format("below %.4g Hz", slice.upper / two_pi));
      rigid = rigid || slice.smallest < rigid_share * reach * reach;
      for (const Eigenpair& pair : slice.pairs) moduli.push_back(std::abs(pair.lambda));
    }
    pencil = {}; // before a count that needs a factor as well
    result.count = count_pairs(std::move(moduli), real, rigid ? count_below(real, floor) : 0, end, reach);
    free_factor(real);
  };
  search(false);
  // Pairs may have moved from one slice to its neighbour, so that only the count of all slices is certain.
  if (result.count.found < result.count.expected) search(true);
  result.solution = join(std::move(slices));
  return result;
}

} // namespace squeal
