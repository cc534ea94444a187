#include "squeal/shooting/orbit.hpp"
#include "beside_orbit.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/shooting/shooting.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

Orbit copy_of(const Orbit& orbit)
{
  Orbit copy{copy_of(orbit.state), orbit.period,      copy_of(orbit.defect),
             copy_of(orbit.rate),  orbit.fluctuation, orbit.residual};
  if (orbit.rest.get()) copy.rest = copy_of(orbit.rest);
  copy.offsets = orbit.offsets;
  return copy;
}

Orbit evaluate(const OrbitProblem& problem, ConvergenceLog& log, Vec state, double period)
{
  Orbit orbit{copy_of(state), period, zeros_like(state), zeros_like(state), 0, 0};
  problem.flow.integrate(period, orbit.state, orbit.defect, orbit.rate);
  ++log.convergence.periods;
  check(VecAXPY(orbit.defect, -1, orbit.state));
  if (const Offsets& offsets = problem.flow.offsets; offsets.motion)
  {
    orbit.offsets = offsets.motion();
    orbit.rest = copy_of(problem.equilibrium.get());
    offsets.find_rest(orbit.rest);
  }
  const Owned<Vec> fluctuation = fluctuation_of(problem, orbit);
  orbit.fluctuation = energy_norm(problem.flow, fluctuation);
  orbit.residual = energy_norm(problem.flow, orbit.defect) / orbit.fluctuation;
  // 0/0: the equilibrium itself, which is no cycle
  if (!std::isfinite(orbit.residual)) orbit.residual = std::numeric_limits<double>::infinity();
  return orbit;
}

void record(ConvergenceLog& log, ShootingStage stage, const Orbit& orbit, PetscInt unknowns, double residual_projected)
{
  Convergence& convergence = log.convergence;
  convergence.records.push_back(
      {stage, unknowns, convergence.periods, orbit.period, residual_projected, orbit.residual});
  log.progress.update(log.done.value_or(static_cast<double>(convergence.periods)),
                      format("%s, %ld periods, T %.6g s, residual %.1e", word(stage), convergence.periods, orbit.period,
                             orbit.residual));
}

void record_full(ConvergenceLog& log, ShootingStage stage, const Orbit& orbit)
{
  record(log, stage, orbit, 2 * dofs_of(orbit.state) + 1, std::nan(""));
}

bool admissible_period(const OrbitProblem& problem, double period)
{
  return period > problem.first_period / 2 && period < problem.first_period * 2;
}

bool collapsing(const OrbitProblem& problem, const Orbit& orbit)
{
  return !(orbit.fluctuation > problem.least_fluctuation);
}

bool slips_one_way(const OrbitProblem& problem, const Orbit& orbit)
{
  constexpr double least = 1e-6, of_accuracy = 1e-5;
  const double allowed = problem.tolerance > 0 ? std::max(problem.tolerance, least) : of_accuracy;
  return orbit.offsets.slip > allowed * orbit.offsets.swing;
}

Owned<Vec> fluctuation_of(const OrbitProblem& problem, const Orbit& orbit)
{
  Owned<Vec> fluctuation = copy_of(orbit.state.get());
  check(VecAXPY(fluctuation, -1, orbit.rest.get() ? orbit.rest.get() : problem.equilibrium.get()));
  return fluctuation;
}

namespace
{

/// The recurrence nearest to the start is where the defect is orthogonal to the flow. [s], from the period's end.
double nearest_recurrence(const OrbitProblem& problem, const Orbit& orbit)
{
  const double speed = energy_norm(problem.flow, orbit.rate);
  const double away = speed > 0 ? -energy_product(problem.flow, orbit.defect, orbit.rate) / (speed * speed) : 0;
  return std::clamp(away, -0.2 * orbit.period, 0.2 * orbit.period);
}

} // namespace

double return_residual(const OrbitProblem& problem, const Orbit& orbit)
{
  const Owned<Vec> missed = copy_of(orbit.defect.get());
  check(VecAXPY(missed, nearest_recurrence(problem, orbit), orbit.rate));
  return energy_norm(problem.flow, missed) / orbit.fluctuation;
}

Orbit integrate_free_periods(const OrbitProblem& problem, ConvergenceLog& log, Vec state, double period,
                             const FreeIntegration& asked)
{
  Owned<Vec> current = copy_of(state);
  const int at_most = std::max(asked.periods, asked.at_most);
  for (int done = 0; done < (asked.periods > 0 ? at_most : 0); ++done)
  {
    const Orbit orbit = evaluate(problem, log, current, period);
    record(log, ShootingStage::free_periods, orbit, 0, std::nan(""));
    log.slips.push_back(orbit.offsets.slip);
    check(VecAXPY(current, 1, orbit.defect));
    // A new period costs a factorisation, so a small correction waits for the last one.
    const bool enough = done + 1 >= asked.periods || return_residual(problem, orbit) <= asked.near_periodic ||
                        !(orbit.fluctuation <= asked.outgrown),
               last = done + 1 == at_most || (enough && !slips_one_way(problem, orbit));
    const double correction = nearest_recurrence(problem, orbit);
    const bool worth_it = last || std::abs(correction) > asked.refactored * period;
    if (worth_it && admissible_period(problem, period + correction)) period += correction;
    if (last) break;
  }
  Orbit orbit = evaluate(problem, log, current, period);
  if (asked.periods > 0) return orbit;
  // A start that is handed over may have another period than the mode.
  for (int tries = 0; tries < 3; ++tries)
  {
    const double correction = nearest_recurrence(problem, orbit);
    if (!(std::abs(correction) > asked.refactored * period) || !admissible_period(problem, period + correction)) break;
    period += correction;
    record(log, ShootingStage::free_periods, orbit, 0, std::nan(""));
    orbit = evaluate(problem, log, current, period);
  }
  return orbit;
}

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
