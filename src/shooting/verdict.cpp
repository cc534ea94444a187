#include "monodromy.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/shooting/shooting.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/LU>

namespace squeal
{

// With d_k the distances, m the multiplier, F the residual and a the part of the fluctuation at which a motion begins:
//     ln d_k = c + k ln g,    |g - m| <= bar of the line + mean of F/d_k + c a.
// F/d_k is what an orbit that does not quite close adds to a period. The last term is what pairs do otherwise at such
// a distance; two motions tell it.

namespace
{

constexpr double first_part = 0.03, smaller = 0.1; // of the fluctuation, of the part before
constexpr int most_motions = 3;

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

/// Distances from an orbit, without their part along the flow. The states of a motion along a complex pair turn on an
/// ellipse. There they would come nearer and go away again whatever the pair does. So the ellipse is made a circle:
/// x = Re(z (r + i s)) + rest is |z| |r| and |rest| away, at a right angle.
class Distance
{
public:
  Distance(const Flow& flow, const Orbit& orbit, const FastestMotion& fastest)
      : flow_(flow), along_(copy_of(orbit.rate.get())), parts_{copy_of(fastest.real.get()), {}}
  {
    normalise(flow_, along_);
    without_flow(parts_.real);
    if (!fastest.imaginary.get()) return;
    parts_.imaginary = copy_of(fastest.imaginary.get());
    without_flow(parts_.imaginary);
    const double a = energy_product(flow_, parts_.real, parts_.real),
                 b = energy_product(flow_, parts_.imaginary, parts_.imaginary),
                 c = energy_product(flow_, parts_.real, parts_.imaginary);
    products_ << a, c, c, b;
  }

  double operator()(const Owned<Vec>& away) const
  {
    without_flow(away);
    const double size = energy_norm(flow_, away);
    constexpr double flat = 1e-6; // an ellipse that is a line
    if (!parts_.imaginary.get() || !(products_.determinant() > std::pow(flat * products_(0, 0), 2))) return size;
    const Eigen::Vector2d seen(energy_product(flow_, parts_.real, away), energy_product(flow_, parts_.imaginary, away));
    const Eigen::Vector2d z = products_.inverse() * seen;
    return std::sqrt(products_(0, 0) * z.squaredNorm() + std::max(0., size * size - z.dot(seen)));
  }

private:
  void without_flow(Vec x) const { check(VecAXPY(x, -energy_product(flow_, along_, x), along_)); }

  const Flow& flow_;
  Owned<Vec> along_; // the flow, of energy norm 1
  FastestMotion parts_;
  Eigen::Matrix2d products_ = Eigen::Matrix2d::Zero();
};

/// A motion beside an orbit, as parts of its fluctuation.
struct BesideMotion
{
  double first = 0;               // where the motion begins
  double lowest = 0, highest = 0; // where it has been seen long enough
  long periods = 0;               // at most
};

/// Distances from the orbit at the ends of periods, without their part along the flow. Where the tangent holds they are
/// multiplied by |m| in every period, of a complex multiplier m too.
std::vector<double> distances_beside(const OrbitProblem& problem, ConvergenceLog& log, const Orbit& orbit,
                                     const FastestMotion& fastest, const BesideMotion& motion)
{
  const Owned<Vec> state = state_beside(problem, orbit, fastest.real, motion.first);
  const Distance distance(problem.flow, orbit, fastest);
  std::vector<double> distances;
  for (long k = 0; k < motion.periods; ++k)
  {
    const Orbit now = evaluate(problem, log, state, orbit.period);
    check(VecAXPY(state, 1, now.defect));
    const Owned<Vec> away = copy_of(state.get());
    check(VecAXPY(away, -1, orbit.state));
    distances.push_back(distance(away) / orbit.fluctuation);
    if (!(distances.back() < motion.highest) || distances.back() < motion.lowest) break;
  }
  return distances;
}

/// The first quarter, where other motions decay, is left out, and so is all beyond the bounds. There a motion's shift
/// in time leaves the flow's direction by its square, or growth ends. A motion whose distance doubles before there is
/// enough for a line has left.
SeenGrowth growth_of(const BesideMotion& motion, std::vector<double> distances, double residual)
{
  const double last = std::isfinite(distances.back()) ? distances.back() : motion.highest,
               periods = static_cast<double>(distances.size());
  if (!(distances.back() < motion.highest) || distances.back() < motion.lowest) distances.pop_back();
  std::vector<double> logarithms(distances.size());
  std::transform(distances.begin(), distances.end(), logarithms.begin(), [](double d) { return std::log(d); });
  SeenGrowth seen = fit_growth(logarithms);
  if (seen.periods == 0)
  {
    const double growth = std::pow(last / motion.first, 1 / periods);
    seen = {last >= 2 * motion.first ? static_cast<long>(periods) : 0, growth, std::abs(growth - 1) / 2};
  }
  seen.part = motion.first;
  double left = 0;
  for (const double distance : distances) left += residual / distance;
  if (!distances.empty()) seen.error += left / static_cast<double>(distances.size());
  return seen;
}

/// Whether the bar of the deciding multiplier, or of its conjugate, alone leaves the verdict open. Not collective.
bool is_left_open_by_one(const Multipliers& multipliers)
{
  if (multipliers.stability != Stability::undecided || !multipliers.complete) return false;
  const std::size_t place = deciding_place(multipliers);
  for (std::size_t i = 0; i < multipliers.values.size(); ++i)
    if (i != place && multipliers.values[i] != std::conj(multipliers.values[place]) &&
        !(multipliers.upper_bound(i) < 1))
      return false;
  return true;
}

/// The growth of the distance from the orbit, until it agrees with the deciding multiplier. Motions start at smaller
/// and smaller parts of the fluctuation, largest first. An unstable orbit takes one start.
std::vector<SeenGrowth> growths_beside(const OrbitProblem& problem, ConvergenceLog& log, const Orbit& orbit,
                                       const FloquetAnalysis& floquet, long periods)
{
  std::vector<SeenGrowth> seen;
  if (!floquet.fastest.real.get() || floquet.multipliers.values.empty()) return seen;
  const std::size_t place = deciding_place(floquet.multipliers);
  const double followed = std::abs(floquet.multipliers.values[place]), bar = floquet.multipliers.errors[place];
  double part = first_part, highest = 1. / 3;
  for (int k = 0; k < most_motions; ++k)
  {
    // the square of the shift in time is to the distance as the distance is to the fluctuation
    const BesideMotion motion{part, std::max(part * part / 0.3, 10 * orbit.residual), highest, periods};
    SeenGrowth now = growth_of(motion, distances_beside(problem, log, orbit, floquet.fastest, motion), orbit.residual);
    // the change of a growth is proportional to the part at least, and 1 - smaller of it is between the two
    if (now.periods > 0 && !seen.empty())
      now.error += std::abs(now.growth - seen.back().growth) * smaller / (1 - smaller);
    const bool unstable = floquet.multipliers.stability == Stability::unstable;
    if (now.periods == 0 && now.growth < 1 && floquet.multipliers.stability == Stability::stable)
      break; // it has come back
    if (now.periods > 0 || unstable) seen.push_back(now);
    if (unstable) break;
    if (now.periods > 0 && std::abs(now.growth - followed) <= now.error + bar) break;
    highest = part;
    part *= smaller;
    if (part < 100 * orbit.residual) break; // no part that the orbit's own error does not hide
  }
  return seen;
}

/// The number of periods over which motions beside the orbit are watched: as many as are asked for. Else as many as
/// make a motion by the tangent four times as large, where the verdict is not "stable" and these are few. Where only
/// one multiplier's bar leaves it open, it takes as many as are affordable or as the search took.
long watched_periods(const OrbitProblem& problem, const ShootingOptions& options, const ConvergenceLog& log,
                     const Multipliers& multipliers)
{
  constexpr double enough = 200;                             // a growth of 1e-3 a period shows
  const long at_most = is_dear(problem.flow.work) ? 20 : 80; // periods
  if (options.watched_periods >= 0) return options.watched_periods;
  if (multipliers.values.empty()) return 0;
  const double affordable = affordable_work / problem.flow.work;
  const bool whole =
      multipliers.method == MultiplierMethod::whole; // a projection's bar is the grid's, of a motion as well
  if (multipliers.stability == Stability::stable) return 0;
  const long searched = log.convergence.periods;
  const double largest = std::abs(multipliers.values[deciding_place(multipliers)]);
  long periods = 0;
  if (largest > 1 && std::log(4) <= static_cast<double>(at_most) * std::log(largest) &&
      searched + at_most <= options.max_periods)
    periods = at_most;
  const bool by_bar = is_left_open_by_one(multipliers) && largest_reaches_across(multipliers);
  if (by_bar && whole)
    periods =
        std::max(periods, static_cast<long>(std::min(enough, std::max(affordable, static_cast<double>(searched)))));
  return periods;
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

void decide_by_growth(const std::vector<SeenGrowth>& seen, Multipliers& multipliers)
{
  if (seen.empty()) return;
  const SeenGrowth& nearest = seen.back();
  const std::size_t place = deciding_place(multipliers);
  const std::complex<double> followed = multipliers.values[place];
  const bool stays_away = nearest.growth + nearest.error > 1 &&
                          std::abs(nearest.growth - std::abs(followed)) > nearest.error + multipliers.errors[place];
  if (multipliers.stability == Stability::stable && stays_away)
  {
    multipliers.stability = Stability::undecided;
    multipliers.would_decide = format("by its multipliers it attracts, but a motion that began %.2g %% beside it was "
                                      "seen to grow %.4g times a period: other steps a period",
                                      100 * nearest.part, nearest.growth);
    return;
  }
  // one that neither grows nor comes back has left for another motion near by
  const bool comes_back = nearest.growth < 1 && (nearest.periods == 0 ||
                                                 std::pow(nearest.growth, static_cast<double>(nearest.periods)) < 0.5);
  const bool is_doubted =
      multipliers.method == MultiplierMethod::whole ? comes_back : !(nearest.growth - nearest.error > 1);
  if (multipliers.stability == Stability::unstable && is_doubted)
  {
    multipliers.stability = Stability::undecided;
    multipliers.crossing = Crossing::none;
    multipliers.would_decide =
        format("small motions grow %.4g times a period by the tangent, but one that began %.2g %% beside the cycle "
               "grows %.4g times: contact that only just opens, closes or sticks; other steps a period, or "
               "-cycle_watched_periods",
               std::abs(followed), 100 * nearest.part, nearest.growth);
    return;
  }
  if (multipliers.stability != Stability::undecided) return;
  const bool grows = nearest.growth > 1;
  if (!grows && !is_left_open_by_one(multipliers)) return;
  const double of_grid = moved_by_grid(multipliers, followed);
  if (of_grid > std::abs(nearest.growth - 1))
    multipliers.would_decide = format(
        "a motion beside the cycle grows %.4f times a period, but the grid of time moves a shift in time by %.1e: "
        "it may be neutral, as the phase between parts that do not know of each other; more steps a period "
        "would decide",
        nearest.growth, of_grid);
  if (!(std::abs(nearest.growth - 1) > nearest.error + of_grid)) return;
  multipliers.stability = grows ? Stability::unstable : Stability::stable;
  if (grows) multipliers.crossing = crossing_of(followed);
  multipliers.would_decide.clear();
}

Verdict judge(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log, const Orbit& orbit)
{
  Verdict verdict;
  Multipliers& multipliers = verdict.floquet.multipliers;
  const char* sought = "its multipliers were sought";
  try
  {
    verdict.floquet = find_multipliers(problem, options, orbit);
    multipliers.offsets = orbit.offsets.held;
    sought = "a motion beside it was watched";
    const long periods = watched_periods(problem, options, log, multipliers);
    if (periods == 0) return verdict;
    multipliers.seen = growths_beside(problem, log, orbit, verdict.floquet, periods);
    const bool decided = multipliers.stability != Stability::undecided;
    decide_by_growth(multipliers.seen, multipliers);
    verdict.doubted = decided && multipliers.stability == Stability::undecided &&
                      multipliers.seen.back().growth + multipliers.seen.back().error > 1;
  }
  catch (const Interrupted&) // on all ranks alike: the orbit stays
  {
    verdict.cut_short = true;
    multipliers.stability = Stability::undecided;
    multipliers.would_decide = std::string("the run was ended while ") + sought;
  }
  return verdict;
}

void refuse_repelling(const Verdict& verdict, std::size_t other_unstable, Outcome& outcome)
{
  if (outcome.kind != OutcomeKind::converged) return;
  const Multipliers& multipliers = verdict.floquet.multipliers;
  if (multipliers.stability == Stability::unstable)
  {
    outcome.kind = other_unstable == 0 ? OutcomeKind::unstable_cycle : OutcomeKind::not_periodic;
    const bool as_seen = largest_reaches_across(multipliers) && !multipliers.seen.empty();
    outcome.reason = format("the cycle found repels: a small motion beside it grows %.4g times a period (%s)",
                            as_seen ? multipliers.seen.back().growth : std::abs(multipliers.values.front()),
                            word(multipliers.crossing));
    if (other_unstable > 0) outcome.reason += format("; %zu modes are unstable", other_unstable + 1);
  }
  else if (verdict.doubted)
  {
    outcome.kind = OutcomeKind::unstable_cycle;
    outcome.reason = "whether the cycle found repels is undecided: " + multipliers.would_decide;
  }
}

} // namespace squeal
