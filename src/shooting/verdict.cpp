#include "squeal/shooting/verdict.hpp"

#include "beside_orbit.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Whether a motion that began a part beside an orbit leaves it: its distance doubles, or grows to four times its least
/// where that is above what the orbit's residual adds. NaN has left, too.
bool leaves(const std::vector<double>& distances, double part, double residual)
{
  double least = HUGE_VAL;
  for (const double distance : distances)
  {
    if (!(distance < 2 * part) || distance >= 4 * std::max(least, 10 * residual)) return true;
    least = std::min(least, distance);
  }
  return false;
}

/// Holds a verdict against a motion beside the orbit, until its distance has doubled or is a tenth: other motions may
/// shrink it at first. Doubling shows that an undecided orbit repels, and so does growth to four times its least.
/// Where it does neither over periods that should make it four times as large, the verdict "unstable" is undecided:
/// where contact only just opens, closes or sticks, the tangent holds in a neighbourhood that no motion stays in. Where
/// the largest multiplier is hardly above 1, that many periods cost too much.
void hold_against_motion(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                         const Orbit& orbit, Verdict& verdict)
{
  constexpr double part = 0.01; // of the fluctuation: above the orbit's tolerance, below its saturation
  const long at_most = is_dear(problem.flow.work) ? 20 : 80; // periods
  Multipliers& multipliers = verdict.floquet.multipliers;
  const double largest = multipliers.values.empty() ? 0 : std::abs(multipliers.values.front());
  const bool unstable = multipliers.stability == Stability::unstable;
  if (!verdict.floquet.fastest.real.get() || !(largest > 1) || multipliers.stability == Stability::stable) return;
  if (!(std::log(4) / std::log(largest) <= static_cast<double>(at_most))) return;
  if (log.convergence.periods + at_most > options.max_periods) return;
  const std::vector<double> distances =
      distances_beside(problem, log, orbit, verdict.floquet.fastest, {part, 0.1 * part, 2 * part, at_most});
  if (leaves(distances, part, orbit.residual)) verdict.beside = Beside::leaves;
  if (!unstable || verdict.beside == Beside::leaves) return;
  if (distances.back() > 0.5 * part) verdict.beside = Beside::unclear;
  multipliers.stability = Stability::undecided;
  multipliers.crossing = Crossing::none;
  multipliers.would_decide =
      format("small motions grow %.4g times a period by the tangent, but one that began %.2g %% beside the cycle is "
             "%.2g %% away after %zu periods: contact that only just opens, closes or sticks; other steps a period, or "
             "-cycle_watched_periods",
             largest, 100 * part, 100 * distances.back(), distances.size());
}

/// The number of periods over which motions beside the orbit are watched: as many as are asked for. Else where only the
/// bar of the largest multiplier of a whole matrix leaves the verdict open, as many as are affordable or as the search
/// took.
long watched_periods(const Flow& flow, const ShootingOptions& options, const ConvergenceLog& log,
                     const Verdict& verdict)
{
  constexpr double enough = 200; // a growth of 1e-3 a period shows
  const Multipliers& multipliers = verdict.floquet.multipliers;
  if (options.watched_periods >= 0) return options.watched_periods;
  if (verdict.beside != Beside::not_seen || !is_left_open_by_largest(multipliers)) return 0;
  if (!largest_reaches_across(multipliers)) return 0;          // what leaves it open is the motion seen beside it
  if (multipliers.method != MultiplierMethod::whole) return 0; // a projection's bar is the grid's, of a motion as well
  const auto searched = static_cast<double>(log.convergence.periods);
  return static_cast<long>(std::min(enough, std::max(affordable_work / flow.work, searched)));
}

} // namespace

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
    hold_against_motion(problem, options, log, orbit, verdict);
    const long periods = watched_periods(problem.flow, options, log, verdict);
    if (periods > 0) multipliers.seen = growths_beside(problem, log, orbit, verdict.floquet, periods);
    decide_by_growth(multipliers.seen, multipliers);
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
  else if (verdict.beside != Beside::not_seen)
  {
    outcome.kind = OutcomeKind::unstable_cycle;
    outcome.reason = verdict.beside == Beside::leaves
                         ? "the cycle found repels: integrated beside it, a motion leaves it"
                         : "whether the cycle found repels is undecided: " + multipliers.would_decide;
  }
}

} // namespace squeal
