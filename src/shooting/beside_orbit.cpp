/// With d_k the distances, m the multiplier, F the residual and a the part of the fluctuation at which a motion begins:
///     ln d_k = c + k ln g,    |g - m| <= bar of the line + mean of F/d_k + c a.
/// F/d_k is what an orbit that does not quite close adds to a period. The last term is what pairs do otherwise at such
/// a distance; two motions tell it.
#include "beside_orbit.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

constexpr double first_part = 0.03, smaller = 0.1; // of the fluctuation, of the part before
constexpr int motions = 3;

/// The slope of a line through all but the first quarter of the logarithms, and twice its standard error. Neighbours
/// are correlated: eight values in a row count as one.
SeenGrowth fit_growth(const std::vector<double>& logarithms)
{
  const std::size_t first = logarithms.size() / 4, count = logarithms.size() - first;
  if (count < 16) return {};
  const double middle = static_cast<double>(count - 1) / 2;
  double sum = 0, moment = 0, squares = 0, weight = 0;
  for (std::size_t k = 0; k < count; ++k)
  {
    const double x = static_cast<double>(k) - middle;
    sum += logarithms[first + k];
    moment += x * logarithms[first + k];
    weight += x * x;
  }
  const double slope = moment / weight, mean = sum / static_cast<double>(count);
  for (std::size_t k = 0; k < count; ++k)
    squares += std::pow(logarithms[first + k] - mean - slope * (static_cast<double>(k) - middle), 2);
  const double error = 2 * std::sqrt(8 * squares / static_cast<double>(count) / weight);
  return {static_cast<long>(logarithms.size()), std::exp(slope), error * std::exp(slope)};
}

/// The number of periods after which the distance of a motion that turns in the plane of a complex pair has swung once:
/// its states are on an ellipse, and half a turn brings the same distance.
double periods_of_a_swing(std::complex<double> multiplier)
{
  if (multiplier.imag() == 0) return 0;
  const double angle = std::abs(std::arg(multiplier));
  return std::numbers::pi / std::min(angle, std::numbers::pi - angle);
}

/// The first quarter is left out, where other motions decay, and what comes after the bounds: the shift in time that a
/// motion ends with leaves the flow's direction by its square, and far away growth ends.
SeenGrowth growth_of(const BesideMotion& motion, std::vector<double> distances, double residual)
{
  if (!(distances.back() < motion.highest) || distances.back() < motion.lowest) distances.pop_back();
  std::vector<double> logarithms(distances.size());
  std::transform(distances.begin(), distances.end(), logarithms.begin(), [](double d) { return std::log(d); });
  SeenGrowth seen = fit_growth(logarithms);
  seen.part = motion.first;
  double left = 0;
  for (const double distance : distances) left += residual / distance;
  seen.error += left / static_cast<double>(distances.size());
  return seen;
}

} // namespace

Owned<Vec> state_beside(const OrbitProblem& problem, const Orbit& orbit, Vec fastest, double part)
{
  const Owned<Vec> fluctuation = fluctuation_of(problem, orbit);
  const double outwards = energy_product(problem.flow, fluctuation, fastest) > 0 ? 1 : -1;
  Owned<Vec> state = copy_of(orbit.state.get());
  check(VecAXPY(state, -part * outwards * orbit.fluctuation, fastest));
  return state;
}

std::vector<double> distances_beside(const OrbitProblem& problem, ConvergenceLog& log, const Orbit& orbit, Vec fastest,
                                     const BesideMotion& motion)
{
  const Owned<Vec> state = state_beside(problem, orbit, fastest, motion.first), flow = copy_of(orbit.rate.get());
  normalise(problem.flow, flow);
  std::vector<double> distances;
  for (long k = 0; k < motion.periods; ++k)
  {
    const Orbit now = evaluate(problem, log, state, orbit.period);
    check(VecAXPY(state, 1, now.defect));
    const Owned<Vec> away = copy_of(state.get());
    check(VecAXPY(away, -1, orbit.state));
    check(VecAXPY(away, -energy_product(problem.flow, flow, away), flow));
    distances.push_back(energy_norm(problem.flow, away) / orbit.fluctuation);
    if (!(distances.back() < motion.highest) || distances.back() < motion.lowest) break;
  }
  return distances;
}

std::vector<SeenGrowth> growths_beside(const OrbitProblem& problem, ConvergenceLog& log, const Orbit& orbit,
                                       const FloquetAnalysis& floquet, long periods)
{
  std::vector<SeenGrowth> seen;
  if (!floquet.fastest.get() || floquet.multipliers.values.empty()) return seen;
  const double largest = std::abs(floquet.multipliers.values.front()), bar = floquet.multipliers.errors.front();
  const double swing = periods_of_a_swing(floquet.multipliers.values.front());
  double part = first_part, highest = 1. / 3;
  for (int k = 0; k < motions; ++k)
  {
    // the square of the shift in time is to the distance as the distance is to the fluctuation
    const BesideMotion motion{part, std::max(part * part / 0.3, 10 * orbit.residual), highest, periods};
    SeenGrowth now = growth_of(motion, distances_beside(problem, log, orbit, floquet.fastest, motion), orbit.residual);
    if (0.75 * static_cast<double>(now.periods) < swing) now.periods = 0; // a part of a swing looks like growth
    // the change of a growth is proportional to the part at least, and 1 - smaller of it is between the two
    if (now.periods > 0 && !seen.empty())
      now.error += std::abs(now.growth - seen.back().growth) * smaller / (1 - smaller);
    if (now.periods > 0) seen.push_back(now);
    if (now.periods > 0 && std::abs(now.growth - largest) <= now.error + bar) break;
    highest = part;
    part *= smaller;
    if (part < 100 * orbit.residual) break; // no part that the orbit's own error does not hide
  }
  return seen;
}

} // namespace squeal
