#include "reduced_cycle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

/// What a cycle at some number of steps a period is worth.
struct Found
{
  int steps = 0;
  double period = 0, energy = 0; // [s], [J]
};

/// Errors that fall with this power of the steps: what of the difference between a and b steps is left at c.
double left_at(int a, int b, int c, double order)
{
  return std::pow(c, -order) / (std::pow(a, -order) - std::pow(b, -order));
}

/// Errors of a cycle beside another with more or fewer steps.
void judge_steps(Fidelity& fidelity, const Found& other, const Found& cycle, double order)
{
  const double left = std::abs(left_at(other.steps, cycle.steps, cycle.steps, order));
  fidelity.step_frequency_error = left * std::abs(other.period / cycle.period - 1);
  fidelity.step_energy_error = left * std::abs(other.energy / cycle.energy - 1);
}

double step_error(const Fidelity& fidelity)
{
  return std::max(fidelity.step_frequency_error, fidelity.step_energy_error);
}

/// At which three energies converge: 2 where the motion is smooth, less through impacts, never taken for less than 1.
double order_of(const Found& coarse, const Found& middle, const Found& fine)
{
  const double seen = (coarse.energy - middle.energy) / (middle.energy - fine.energy);
  double order = 1;
  const auto expected = [&](double p)
  {
    return (std::pow(coarse.steps, -p) - std::pow(middle.steps, -p)) /
           (std::pow(middle.steps, -p) - std::pow(fine.steps, -p));
  };
  while (order < 2 && expected(order) < seen) order += .05;
  return order;
}

/// -cycle_start: the full shooting starts from the estimate, or from the reduced model's cycle.
bool starts_reduced()
{
  const std::array<const char*, 2> starts = {"estimate", "reduced"};
  PetscInt start = 0;
  check(PetscOptionsGetEList(nullptr, "cycle_", "-start", starts.data(), 2, &start, nullptr));
  return start == 1;
}

/// The full model's shooting, from one number of steps a period to the next.
struct Pursuit
{
  Fitting& fitting;
  PeriodMap& map;
  Shooting& shooting;
  const LimitCycle& seen; // of the last period integrated
  Orbit at;
  std::string reason{}; // what is in the way

  Found found() const { return {map.steps, at.period, seen.mean_fluctuating_energy}; }
};

void move_to(Pursuit& pursuit, Vec state, double period, int steps)
{
  pursuit.map.steps = steps;
  pursuit.at = evaluate(pursuit.shooting, state, period);
  record(pursuit.shooting, "full period", full_unknowns(pursuit.at), std::nan(""), pursuit.at);
}

/// Shoots until what is still to come is below half of the wish, by two steps' word: one may move the energy by nothing
/// by chance. Returns whether it got there.
bool shoot_on(Pursuit& pursuit)
{
  pursuit.shooting.last = {HUGE_VAL, HUGE_VAL};
  pursuit.shooting.wish = pursuit.fitting.result.fidelity.accuracy / 2;
  Finish finish = shoot_multisecant(pursuit.shooting, pursuit.at);
  pursuit.at = std::move(finish.orbit);
  if (finish.ending == Ending::converged) return true;
  pursuit.reason = "the wish was not met in " + std::to_string(pursuit.shooting.periods) + " periods of the full model";
  return false;
}

/// The cycle at few steps a period and at twice as many; where these are still too few, at as many as the errors of
/// both foretell, to which both are extrapolated: one or two periods of many steps do.
void pursue(Pursuit& pursuit)
{
  Fitting& fitting = pursuit.fitting;
  Fidelity& fidelity = fitting.result.fidelity;
  if (!shoot_on(pursuit)) return;
  Orbit last = copy_of(pursuit.at);
  Found coarse = pursuit.found();
  move_to(pursuit, last.state, last.period, 2 * coarse.steps);
  if (!shoot_on(pursuit)) return;
  Found fine = pursuit.found();
  double sure = 1, likely = 2; // orders, until a third number of steps tells
  for (int tries = 0;; ++tries)
  {
    fitting.steps = fine.steps;
    judge_steps(fidelity, coarse, fine, likely);
    const double needed = fine.steps * std::pow(3 * step_error(fidelity) / fidelity.accuracy, 1 / likely);
    judge_steps(fidelity, coarse, fine, sure);
    if (step_error(fidelity) <= fidelity.accuracy / 2) return;
    if (tries == 5) break;
    const int all = 4 * static_cast<int>(std::ceil(std::max(needed, 1.5 * fine.steps) / 4));
    const double beyond =
        left_at(coarse.steps, fine.steps, fine.steps, likely) - left_at(coarse.steps, fine.steps, all, likely);
    Orbit now = std::exchange(pursuit.at, {});
    check(VecAXPBY(last.state, 1 + beyond, -beyond, now.state));
    move_to(pursuit, last.state, now.period + beyond * (now.period - last.period), all);
    if (!shoot_on(pursuit)) return;
    sure = likely = order_of(coarse, fine, pursuit.found());
    coarse = std::exchange(fine, pursuit.found());
    last = std::move(now);
  }
  pursuit.reason = "the wish needs more than " + std::to_string(fine.steps) + " steps a period";
}

/// The cycle of the full model as far as it is wished for; says what is in the way.
std::string fit(Fitting& fitting, const ShootingStart& start, const Preconditioner& preconditioner,
                const ReducedOrbit& orbit)
{
  const double clock = MPI_Wtime();
  const Full& full = fitting.full;
  Fidelity& fidelity = fitting.result.fidelity;
  if (fidelity.asked == CycleModel::reduced)
  {
    const ReducedOrbit twice = shoot_reduced(fitting, orbit.state, orbit.period, 2 * fitting.steps);
    judge_steps(fidelity, {2 * fitting.steps, twice.period, twice.energy}, {fitting.steps, orbit.period, orbit.energy},
                1);
    if (!twice.converged) fidelity.step_frequency_error = fidelity.step_energy_error = std::nan("");
  }
  PeriodMap map{full.structure, full.interface, fitting.steps, full.settings.theta};
  map.reactions = full.equilibrium.reactions;
  map.contact_tolerance = fidelity.contact_tolerance;
  LimitCycle cycle;
  const auto integrate = [&](double period, Vec from, Vec end, Vec rate)
  {
    cycle = {};
    cycle.period = period;
    cycle.start = {copy_of(displacement(from)), copy_of(velocity(from)), 0, {}};
    const State last = measure(map, full.equilibrium, full.probes, 32, rate, cycle);
    check(VecCopy(last.u, displacement(end)));
    check(VecCopy(last.v, velocity(end)));
  };
  const Flow flow{integrate, full.structure.M, full.structure.K};
  Progress progress(comm_of(start.u), "cycle", 20);
  Shooting shooting = begin_shooting(flow, preconditioner, start, 0, progress);
  shooting.options.max_periods = fitting.options.corrections;
  Pursuit pursuit{fitting, map, shooting, cycle, {}};
  const Owned<Vec> first = state_of(start.u, start.v);
  move_to(pursuit, first, start.period, fitting.steps);
  if (fidelity.asked == CycleModel::automatic)
    pursue(pursuit);
  else
    judge(shooting, pursuit.at, next_step(shooting, pursuit.at));

  cycle.steps_per_period = map.steps;
  cycle.theta = map.theta;
  cycle.newton_iterations = shooting.iterations;
  cycle.periods_integrated = shooting.periods;
  cycle.records = shooting.records;
  cycle.residual_projected = std::nan("");
  cycle.residual_full = pursuit.at.residual;
  cycle.outcome = {OutcomeKind::converged, "", shooting.iterations, pursuit.at.residual};
  fitting.result.cycle = std::move(cycle);
  fidelity.steps_per_period = map.steps;
  fidelity.full_periods = shooting.periods;
  fidelity.frequency_error = shooting.to_come.frequency;
  fidelity.energy_error = shooting.to_come.energy;
  fidelity.full_seconds += MPI_Wtime() - clock;
  return pursuit.reason;
}

/// By way of the reduced model; says what is in the way.
std::string by_reduced_model(Fitting& fitting)
{
  const Full& full = fitting.full;
  if (full.unstable.size() > 1) return "several modes are unstable: only the full model's shooting wakes them all";
  ReducedOrbit orbit;
  const std::string problem = first_orbit(fitting, orbit);
  if (!problem.empty()) return problem;
  const Preconditioner preconditioner =
      reduced_preconditioner(fitting.reduced.model, full.structure, fitting.reduced.inside);
  const Owned<Vec> motion = motion_of(full, fitting.reduced.model, orbit.state);
  check(VecAXPY(displacement(motion), 1, full.equilibrium.u));
  const ShootingStart start{full.equilibrium.u, displacement(motion), velocity(motion), orbit.period, {}, {}};
  if (fitting.result.fidelity.asked != CycleModel::full) return fit(fitting, start, preconditioner, orbit);
  fitting.result.cycle = shoot_at_model(full.structure, full.interface, full.equilibrium, start, preconditioner,
                                        full.settings, 0, full.probes);
  return {};
}

} // namespace

FittedCycle find_fitted_cycle(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                              const Modes& modes, const Estimate& estimate, const CycleSettings& settings,
                              CycleModel asked, double accuracy, Mat probes)
{
  const auto unstable = static_cast<std::size_t>(std::max(modes.unstable_count, 1));
  const Full full{structure, interface, equilibrium, modes.modes, std::span(modes.modes).first(unstable),
                  estimate,  settings,  probes};
  const bool adaptive = asked == CycleModel::automatic, from_reduced = starts_reduced() && asked == CycleModel::full;
  Fitting fitting(full);
  fitting.steps = adaptive ? std::min(64, settings.steps_per_period) : settings.steps_per_period;
  fitting.tolerance = from_reduced ? 1e-3 : 3e-4 * accuracy; // a start need not be better; slow motions multiply it
  FittedCycle& result = fitting.result;
  Fidelity& fidelity = result.fidelity;
  fidelity.asked = asked;
  fidelity.accuracy = accuracy;
  if (asked != CycleModel::full || from_reduced)
  {
    fidelity.used = from_reduced ? CycleModel::full : CycleModel::reduced;
    fidelity.contact_tolerance = 1e-3 * accuracy;
    fidelity.reason = by_reduced_model(fitting);
    if (fidelity.reason.empty())
    {
      if (!settings.save_state.empty()) write_state(result.cycle.start, structure, settings.save_state);
      return std::move(result);
    }
  }
  if (asked == CycleModel::reduced)
  {
    result.cycle.outcome.kind = unstable > 1 ? OutcomeKind::refused : OutcomeKind::not_converged;
    result.cycle.outcome.reason = fidelity.reason;
    return std::move(result);
  }
  fidelity.used = CycleModel::full; // of whose errors nothing is known
  fidelity.frequency_error = fidelity.energy_error = std::nan("");
  fidelity.step_frequency_error = fidelity.step_energy_error = std::nan("");
  const double clock = MPI_Wtime();
  CycleSettings refined = settings;
  refined.steps_per_period = std::max(settings.steps_per_period, fitting.steps);
  result.cycle = find_cycle(structure, interface, equilibrium, full.unstable, estimate, refined, probes);
  fidelity.steps_per_period = refined.steps_per_period;
  fidelity.full_seconds += MPI_Wtime() - clock;
  fidelity.full_periods += result.cycle.periods_integrated;
  return std::move(result);
}

} // namespace squeal
