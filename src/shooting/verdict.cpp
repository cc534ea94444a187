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

/// The number of periods over which motions beside the orbit are watched: as many as are asked for. Else as many as
/// make a motion by the tangent four times as large, where the verdict is not "stable" and these are few. Of a whole
/// matrix that says "stable" as many as show a decay, since a contact that touches and leaves within two steps
/// forgets when it did; where only the bar of one of its multipliers leaves it open, as many as are affordable or as
/// the search took.
long watched_periods(const OrbitProblem& problem, const ShootingOptions& options, const ConvergenceLog& log,
                     const Multipliers& multipliers)
{
  constexpr double enough = 200;                             // a growth of 1e-3 a period shows
  const long at_most = is_dear(problem.flow.work) ? 20 : 80; // periods
  if (options.watched_periods >= 0) return options.watched_periods;
  if (multipliers.values.empty()) return 0;
  constexpr double to_see_it_decay = 32;
  const double affordable = affordable_work / problem.flow.work;
  const bool whole =
      multipliers.method == MultiplierMethod::whole; // a projection's bar is the grid's, of a motion as well
  if (multipliers.stability == Stability::stable)
    return whole ? static_cast<long>(std::min(affordable, to_see_it_decay)) : 0;
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
