#include "squeal/analysis/slices.hpp"

#include "squeal/analysis/complex_shift.hpp"
#include "squeal/analysis/projection.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;

constexpr int per_slice = 70;            // pairs
constexpr double usual = .03, wide = .1; // [rad] by which friction may turn a pair: the change of its damping ratio
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

// The pairs expected in a slice, and those found in the disc that is searched about them.
struct Slice
{
  double lower = 0, upper = 0; // [rad/s]
  int expected = 0;
  Complex centre;    // at the angle of those expected,
  double spread = 0; // and the farthest of them from it
  std::vector<Eigenpair> pairs;

  Window window() const { return {lower * lower, upper * upper}; }
};

Slice slice_between(const std::vector<Complex>& predicted, double lower, double upper)
{
  Slice slice{lower, upper, 0, 0, 0, {}};
  double angle = 0;
  for (const Complex lambda : predicted)
    if (std::abs(lambda) >= lower && std::abs(lambda) < upper)
    {
      angle += std::arg(lambda);
      ++slice.expected;
    }
  angle = slice.expected > 0 ? angle / slice.expected : std::numbers::pi / 2;
  slice.centre = std::polar((lower + upper) / 2, angle);
  for (const Complex lambda : predicted)
    if (std::abs(lambda) >= lower && std::abs(lambda) < upper)
      slice.spread = std::max(slice.spread, std::abs(lambda - slice.centre));
  return slice;
}

// The disc holds those expected, and all of the slice whose angle is `slack` [rad] or less from the centre's. If the
// Krylov space grows too large the slice stays as it is, and the count tells.
void find_pairs(Slice& slice, const QuadraticProblem& problem, ComplexFactor& factor, double slack)
{
  factor.move_to(slice.centre);
  const Complex corner = std::polar(slice.upper, std::arg(slice.centre) + slack);
  const double radius = std::max(1.02 * slice.spread, std::abs(corner - slice.centre));
  const NearestPairs nearest = solve_nearest_pairs(problem, factor, radius, slice.expected);
  if (!nearest.converged) return;
  slice.pairs = eigenpairs(problem, nearest.lambda, nearest.y);
  std::erase_if(slice.pairs, [&](const Eigenpair& pair) { return !slice.window().holds(pair.lambda); });
}

int found_in(const std::vector<Slice>& slices)
{
  int count = 0;
  for (const Slice& slice : slices) count += static_cast<int>(slice.pairs.size());
  return count;
}

int expected_in(const std::vector<Slice>& slices)
{
  int count = 0;
  for (const Slice& slice : slices) count += slice.expected;
  return count;
}

// If pairs are missing, friction moved them far: wherever a slice has fewer than expected, more is searched. Between
// neighbours pairs may have changed places, so that only the sum is sure.
void search_wider(std::vector<Slice>& slices, const QuadraticProblem& problem, ComplexFactor& factor)
{
  for (Slice& slice : slices)
    if (found_in(slices) < expected_in(slices) && static_cast<int>(slice.pairs.size()) < slice.expected)
      find_pairs(slice, problem, factor, wide);
}

} // namespace

PairCount count_pairs(const QuadraticSolution& solution, const std::vector<double>& omega, double floor, double edge)
{
  PairCount count{edge / two_pi, count_below(omega, edge) - count_below(omega, floor), 0};
  for (const Eigenpair& pair : solution.pairs) count.found += std::abs(pair.lambda) < edge;
  return count;
}

std::vector<Complex> predicted_pairs(const RealModes& modes, Mat C)
{
  std::vector<Complex> predicted;
  for (std::size_t k = 0; k < modes.omega.size(); ++k)
  {
    const double omega = modes.omega[k];
    const Owned<Vec> force = zeros_like(modes.shapes[k]);
    double damping = 0;
    check(MatMult(C, modes.shapes[k], force));
    check(VecDot(modes.shapes[k], force, &damping));
    const double ratio = omega > 0 ? std::clamp(damping / (2 * omega), -1., 1.) : 0;
    predicted.push_back(std::polar(omega, std::acos(-ratio)));
  }
  return predicted;
}

CountedSolution solve_by_slices(const QuadraticProblem& problem, const std::vector<Complex>& predicted, double band,
                                double reach)
{
  CountedSolution result;
  QuadraticSolution& solution = result.solution;
  solution.outcome = {"converged", "", 0, 0};
  std::vector<double> omega;
  for (const Complex lambda : predicted) omega.push_back(std::abs(lambda));
  const double floor = std::sqrt(vibration_floor(norms_of(problem)));
  const std::vector<double> edges = plan(omega, floor, two_pi * band, two_pi * reach);
  ComplexFactor factor(problem);
  std::vector<Slice> slices;
  for (std::size_t k = 1; k < edges.size(); ++k)
  {
    slices.push_back(slice_between(predicted, edges[k - 1], edges[k]));
    find_pairs(slices.back(), problem, factor, usual);
    ++solution.outcome.iterations;
    if (edges[k] < two_pi * band) continue;
    if (found_in(slices) < expected_in(slices)) search_wider(slices, problem, factor);
    if (found_in(slices) == expected_in(slices)) break;
  }
  for (Slice& slice : slices)
    for (Eigenpair& pair : slice.pairs) solution.pairs.push_back(std::move(pair));
  result.count = count_pairs(solution, omega, floor, slices.back().upper);
  settle(solution);
  return result;
}

} // namespace squeal
