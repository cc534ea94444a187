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

constexpr int per_slice = 50; // pairs
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

// The pairs expected in a slice, and the disc about them that must be searched: all of the slice at their angle, and
// a tenth more for what friction moves.
struct Slice
{
  double lower = 0, upper = 0; // [rad/s]
  int expected = 0;
  Complex centre;
  double radius = 0;

  Window window() const { return {lower * lower, upper * upper}; }
};

Slice slice_between(const std::vector<Complex>& predicted, double lower, double upper)
{
  Slice slice{lower, upper, 0, 0, 0};
  double angle = 0;
  for (const Complex lambda : predicted)
    if (std::abs(lambda) >= lower && std::abs(lambda) < upper)
    {
      angle += std::arg(lambda);
      ++slice.expected;
    }
  angle = slice.expected > 0 ? angle / slice.expected : std::numbers::pi / 2;
  slice.centre = std::polar((lower + upper) / 2, angle);
  slice.radius = (upper - lower) / 2;
  for (const Complex lambda : predicted)
    if (std::abs(lambda) >= lower && std::abs(lambda) < upper)
      slice.radius = std::max(slice.radius, std::abs(lambda - slice.centre));
  slice.radius *= 1.1;
  return slice;
}

// If the Krylov space grows too large the slice stays empty, and the count tells.
std::vector<Eigenpair> find_pairs(const QuadraticProblem& problem, ComplexFactor& factor, const Slice& slice)
{
  factor.move_to(slice.centre);
  const NearestPairs nearest = solve_nearest_pairs(problem, factor, slice.radius, slice.expected);
  std::vector<Eigenpair> pairs;
  if (nearest.converged) pairs = eigenpairs(problem, nearest.lambda, nearest.y);
  std::erase_if(pairs, [&](const Eigenpair& pair) { return !slice.window().holds(pair.lambda); });
  return pairs;
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
  for (std::size_t k = 1; k < edges.size(); ++k)
  {
    for (Eigenpair& pair : find_pairs(problem, factor, slice_between(predicted, edges[k - 1], edges[k])))
      solution.pairs.push_back(std::move(pair));
    ++solution.outcome.iterations;
    result.count = count_pairs(solution, omega, floor, edges[k]);
    if (edges[k] >= two_pi * band && result.count.expected == result.count.found) break;
  }
  settle(solution);
  return result;
}

} // namespace squeal
