#include "squeal/shooting/shooting.hpp"

#include "beside_orbit.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/shooting/secants.hpp"
#include "subspace_newton.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Newton on the subspace of the shapes. Before a finish only a better orbit is taken; one that falls onto the
/// equilibrium never is, since the projected residual can only be small there.
Orbit shoot_on_shapes(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log, Orbit start,
                      const std::vector<Vec>& shapes)
{
  std::vector<Owned<Vec>> base;
  for (const Vec shape : shapes)
  {
    const Owned<Vec> none = zeros_like(shape), moved = state_of(shape, none), moving = state_of(none, shape);
    extend_base(problem.flow, options.rank_tolerance, base, moved);
    extend_base(problem.flow, options.rank_tolerance, base, moving);
  }
  Orbit orbit = shoot_on_subspace(problem, options, log, start, base);
  if (collapsing(problem, orbit) || !std::isfinite(orbit.residual)) return start;
  return options.finish == Finish::none || orbit.residual < start.residual ? std::move(orbit) : std::move(start);
}

/// A search for an orbit that attracts.
struct Search
{
  const OrbitProblem& problem;
  const ShootingOptions& options;
  ConvergenceLog& log;
  const ShootingStart& start;
};

/// What shooting from one state led to.
struct Attempt
{
  StageResult found;
  double first_return = 0; // return residual where it started
  Verdict verdict{};       // of a converged orbit

  bool converged() const { return found.ending == StageEnding::converged; }
  bool repels() const { return converged() && verdict.repels(); }
  bool answers() const { return converged() && !verdict.repels() && !verdict.doubted; }
};

/// Whether shooting has found the orbit again. Each is known up to its residual, which slow motions multiply.
bool is_again(const Orbit& orbit, const Orbit& known)
{
  constexpr double of_period = 1e-4, of_fluctuation = 1e-2;
  return std::abs(orbit.period / known.period - 1) < of_period &&
         std::abs(orbit.fluctuation / known.fluctuation - 1) < of_fluctuation;
}

/// Whether the orbit is that of the start, whose rounds are known.
bool repeats_start(const Search& search, const Orbit& orbit)
{
  constexpr double of_period = 0.1; // far from half of it
  return search.start.is_cycle && std::abs(orbit.period / search.start.period - 1) < of_period;
}

/// Shoots from the end of the free motion. Where that leads to the `known` attempt's orbit again, its verdict stands.
Attempt attempt_from(const Search& search, const Orbit& free, const Attempt* known)
{
  const auto& [problem, options, log, start] = search;
  Orbit orbit = copy_of(free);
  const double first_return = return_residual(problem, free);
  if (slips_one_way(problem, free)) return {{std::move(orbit), StageEnding::slips}, first_return};
  if (orbit.residual > problem.tolerance && options.subspace_newtons > 0 && !start.shapes.empty())
    orbit = shoot_on_shapes(problem, options, log, std::move(orbit), start.shapes);
  Attempt attempt{shoot_once(problem, options, log, std::move(orbit)), first_return};
  if (!attempt.converged()) return attempt;
  const int rounds = repeats_start(search, attempt.found.orbit) ? start.rounds : 2;
  attempt.found = prefer_fewer_rounds(problem, options, log, rounds, std::move(attempt.found));
  if (known && known->converged() && is_again(attempt.found.orbit, known->found.orbit))
  {
    attempt.verdict.floquet.multipliers = known->verdict.floquet.multipliers;
    attempt.verdict.doubted = known->verdict.doubted;
  }
  else
    attempt.verdict = judge(problem, options, log, attempt.found.orbit);
  return attempt;
}

/// Whether the second attempt is worth more than the first.
bool better(const Attempt& first, const Attempt& second)
{
  if (first.converged() != second.converged()) return second.converged();
  return second.answers() || (!first.converged() && second.found.orbit.residual < first.found.orbit.residual);
}

/// Whether a motion beside an orbit that repels leaves it so slowly that the search cannot see where it goes. It leaves
/// from a tenth of the fluctuation to all of it. Where periods cost little it is searched all the same.
bool leaves_too_slowly(const Search& search, const Attempt& attempt, int done)
{
  const std::vector<std::complex<double>>& values = attempt.verdict.floquet.multipliers.values;
  const int left = search.options.free_periods - done;
  if (!attempt.repels() || values.empty() || !is_dear(search.problem.flow.work)) return false;
  return std::log(10) > left * std::log(std::max(std::abs(values.front()), 1.));
}

/// Goes on integrating for 20, 40, 80 … periods, and shoots again after each or as soon as the motion returns three
/// times better than where the last attempt started. The motion goes on by itself; once, from beside an orbit that
/// repels. Sets `free` to where it ends.
Attempt search_on(const Search& search, Attempt best, int done, Orbit& free)
{
  const auto& [problem, options, log, start] = search;
  double last_return = best.first_return, side = 0; // side: of the orbit that repels; 0: none was left yet
  int collapses = 0;
  for (int count = 20; !best.answers(); count *= 2)
  {
    const auto left = std::min<long>(options.free_periods - done, options.max_periods - log.convergence.periods);
    if (left <= 0) break;
    Owned<Vec> state = copy_of(free.state.get());
    double period = free.period;
    check(VecAXPY(state, 1, free.defect));
    const bool other_side = side > 0 && collapses > 0; // it fell to rest on the one
    if (best.repels() && (side == 0 || other_side))
    {
      side = other_side ? -1 : 1;
      state = state_beside(problem, best.found.orbit, best.verdict.floquet.fastest.real,
                           0.1 * side); // far enough to leave it in a few periods
      period = best.found.orbit.period;
      collapses = 0;
    }
    const double before = free.fluctuation;
    const long periods = log.convergence.periods;
    free = integrate_free_periods(
        problem, log, state, period,
        {static_cast<int>(std::min<long>(count, left)), last_return / 3, static_cast<int>(left)});
    done += static_cast<int>(log.convergence.periods - periods);
    if (!std::isfinite(free.residual)) break;
    // A motion that decays below what limits it rests in the end; one that grows there is on its way.
    if (collapsing(problem, free))
    {
      if (free.fluctuation < before && ++collapses > 1) break;
      continue;
    }
    Attempt next = attempt_from(search, free, &best);
    last_return = next.first_return;
    if (better(best, next)) best = std::move(next);
  }
  return best;
}

/// How long the motion takes to leave, in a sentence that follows the reason.
std::string leaving_time(const Multipliers& multipliers, double period)
{
  const std::complex<double> fastest = multipliers.values.front();
  const double periods = 1 / std::log(std::abs(fastest));
  return format("; at %.4g Hz it grows e-fold in %.3g periods (%.2g s): a larger -cycle_free_periods follows it",
                std::abs(std::arg(fastest)) / (two_pi * period), periods, periods * period);
}

/// Names the slip of a free motion whose offsets do not come to rest: it walks, or its slip decays.
void note_slip(const std::vector<double>& slips, Outcome& outcome)
{
  constexpr double decayed = 0.5; // over the second half
  const double now = slips.back();
  const bool walks = now > decayed * slips[slips.size() / 2];
  if (walks) outcome.kind = OutcomeKind::not_periodic;
  outcome.reason = walks ? format("a joint walks by %.4g m a period", now)
                         : format("a joint still slips by %.2g m a period, less in each: a larger -cycle_free_periods "
                                  "follows it",
                                  now);
}

/// How the search for an orbit ended, in words.
Outcome outcome_of(const Convergence& convergence, StageEnding ending, double residual)
{
  Outcome outcome{OutcomeKind::not_converged, "", convergence.iterations, residual};
  switch (ending)
  {
  case StageEnding::converged:
    outcome.kind = OutcomeKind::converged;
    break;
  case StageEnding::stalled:
    outcome.reason = "full residual above the tolerance after " + std::to_string(convergence.periods) + " periods";
    break;
  case StageEnding::collapsed:
    outcome.kind = OutcomeKind::collapsed_to_equilibrium;
    outcome.reason = "the fluctuation fell below a tenth of the energy at the start and at the first event that limits "
                     "growth";
    break;
  case StageEnding::slips:
    outcome.reason = "an offset still slips one way after " + std::to_string(convergence.periods) + " periods";
    break;
  case StageEnding::period_left_range:
    outcome.kind = OutcomeKind::not_periodic;
    outcome.reason = "the period left the range between half and twice the first one";
    break;
  }
  return outcome;
}

} // namespace

OrbitProblem problem_of(const Flow& flow, const Preconditioner& preconditioner, const ShootingStart& start,
                        double tolerance)
{
  const Owned<Vec> rest = zeros_like(start.equilibrium);
  return {flow, preconditioner, state_of(start.equilibrium, rest), start.period, tolerance, 0};
}

ShootingResult shoot(const Flow& flow, const Preconditioner& preconditioner, const ShootingStart& start,
                     const ShootingSettings& settings, const ShootingOptions& options)
{
  Progress progress(comm_of(start.u), settings.title, settings.free_periods + 60.);
  ConvergenceLog log{progress, settings.before};
  OrbitProblem problem = problem_of(flow, preconditioner, start, settings.tolerance);
  problem.target_error = settings.target_error;
  const Owned<Vec> first = state_of(start.u, start.v);
  Orbit free =
      integrate_free_periods(problem, log, first, start.period, {settings.free_periods, 0, options.free_periods});
  const int done = static_cast<int>(log.slips.size());
  // Below the first event nothing limits a motion; above it a start may be ten times too large and still find one.
  problem.least_fluctuation = std::min(free.fluctuation, start.first_event) * std::sqrt(0.1);
  const Search search{problem, options, log, start};
  Attempt found = attempt_from(search, free, nullptr);
  const bool slow = leaves_too_slowly(search, found, done);
  if (options.finish != Finish::none && settings.goes_on && !slow)
    found = search_on(search, std::move(found), done, free);
  const bool goes_on = !slow && std::isfinite(free.residual);
  StageEnding ending = found.found.ending;
  if (ending == StageEnding::collapsed) ending = StageEnding::stalled; // unless the free motion decays, too
  if (!found.converged() && goes_on && collapsing(problem, free)) ending = StageEnding::collapsed;

  ShootingResult result;
  result.outcome = outcome_of(log.convergence, ending, found.found.orbit.residual);
  if (!found.converged() && goes_on && slips_one_way(problem, free)) note_slip(log.slips, result.outcome);
  refuse_repelling(found.verdict, start.other_unstable, result.outcome);
  result.ending = found.found.ending;
  if (found.converged())
    result.remaining =
        settings.target_error > 0 ? found.found.remaining : remaining_change(problem, options, found.found.orbit);
  result.multipliers = std::move(found.verdict.floquet.multipliers);
  if (slow) result.outcome.reason += leaving_time(result.multipliers, found.found.orbit.period);
  result.orbit = std::move(found.found.orbit);
  if (goes_on) result.free = std::move(free);
  result.convergence = std::move(log.convergence);
  result.cut_short = found.verdict.cut_short;
  return result;
}

} // namespace squeal
