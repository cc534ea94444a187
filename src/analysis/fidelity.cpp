#include "fitting.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

/// Reduced cycles at so many steps a period, twice and four times as many.
struct Doubled
{
  ReducedOrbit once, twice, four_times;

  bool converged() const { return once.converged && twice.converged && four_times.converged; }

  /// At which the energy converges: 1 where impacts make it, 2 else.
  double order() const
  {
    const double first = std::abs(once.energy - twice.energy), second = std::abs(twice.energy - four_times.energy);
    return std::clamp(std::log2(first / second), 1., 2.);
  }
};

Doubled double_steps(Fitting& fitting, ReducedOrbit once, int steps)
{
  ReducedOrbit twice = shoot_reduced(fitting, once.state, once.period, 2 * steps);
  ReducedOrbit four_times = shoot_reduced(fitting, twice.state, twice.period, 4 * steps);
  return {std::move(once), std::move(twice), std::move(four_times)};
}

/// Errors of a cycle that are 1/part of its difference from the one at twice or half as many steps.
void judge_steps(Fidelity& fidelity, const ReducedOrbit& orbit, const ReducedOrbit& other, double part)
{
  fidelity.step_frequency_error = std::abs(other.period / orbit.period - 1) / part;
  fidelity.step_energy_error = std::abs(other.energy / orbit.energy - 1) / part;
}

double step_error(const Fidelity& fidelity)
{
  return std::max(fidelity.step_frequency_error, fidelity.step_energy_error);
}

/// Steps a period for which the step's error, of this order, is a third of the wish, and its growth rate's (omega
/// h)^2/4 the wish.
int steps_for(const Fidelity& fidelity, int steps, double order)
{
  const double measured = steps * std::pow(3 * step_error(fidelity) / fidelity.accuracy, 1 / order);
  const double theory = std::numbers::pi / std::sqrt(fidelity.accuracy);
  return static_cast<int>(std::ceil(std::max(measured, theory)));
}

/// The reduced cycle with as many steps a period as the wish needs, judged by doublings of the reduced model alone.
/// Says what is in the way, or nothing.
std::string choose_steps(Fitting& fitting, ReducedOrbit& orbit)
{
  Fidelity& fidelity = fitting.result.fidelity;
  Doubled cycles = double_steps(fitting, std::move(orbit), fitting.steps);
  judge_steps(fidelity, cycles.once, cycles.twice, 1 - std::pow(2, -cycles.order()));
  orbit = cycles.once;
  for (int tries = 0; cycles.converged() && fidelity.asked == "auto"; ++tries)
  {
    if (step_error(fidelity) <= fidelity.accuracy / 2) return {};
    if (tries == 5) return "the wish needs more than " + std::to_string(fitting.steps) + " steps a period";
    // far from the limit an order is not seen yet, and the better one costs less to try
    const int quarter = steps_for(fidelity, fitting.steps, tries == 0 ? 2 : cycles.order()) / 4;
    fitting.steps = 4 * std::max(quarter, fitting.steps / 4 + 2);
    const ReducedOrbit& near = cycles.twice;
    cycles =
        double_steps(fitting, shoot_reduced(fitting, near.state, near.period, fitting.steps / 4), fitting.steps / 4);
    judge_steps(fidelity, cycles.four_times, cycles.twice, std::pow(2, cycles.order()) - 1);
    orbit = cycles.four_times;
  }
  if (cycles.converged()) return {};
  fidelity.step_frequency_error = fidelity.step_energy_error = std::nan("");
  return "the reduced model has no cycle at some numbers of steps a period up to " + std::to_string(4 * fitting.steps);
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
  Orbit at;             // of the full model
  ReducedOrbit orbit;   // of the reduced one
  std::string reason{}; // what is in the way
};

void move_to(Pursuit& pursuit, Vec state, double period, int steps)
{
  pursuit.map.steps = steps;
  pursuit.at = evaluate(pursuit.shooting, state, period);
  record(pursuit.shooting, "full period", full_unknowns(pursuit.at), std::nan(""), pursuit.at);
}

/// Shoots until what is still to come is below half of the wish.
void shoot_on(Pursuit& pursuit)
{
  if (!pursuit.reason.empty()) return;
  pursuit.shooting.wish = pursuit.fitting.result.fidelity.accuracy / 2;
  Finish finish = shoot_multisecant(pursuit.shooting, pursuit.at);
  pursuit.at = std::move(finish.orbit);
  if (finish.ending != Ending::converged)
    pursuit.reason =
        "the wish was not met in " + std::to_string(pursuit.shooting.periods) + " periods of the full model";
}

/// What errors of second order in the step leave of the difference between a and b steps a period at c, a < b < c.
double beyond(int a, int b, int c)
{
  const auto error = [](int steps) { return 1. / steps / steps; };
  return (error(b) - error(c)) / (error(a) - error(b));
}

/// With few steps a period first, as many as are wished for last; where these are many more, with some between, and by
/// what those changed further on.
void pursue(Pursuit& pursuit)
{
  Fitting& fitting = pursuit.fitting;
  const int few = fitting.steps;
  shoot_on(pursuit);
  if (!pursuit.reason.empty()) return;
  const double period = pursuit.orbit.period;
  pursuit.reason = choose_steps(fitting, pursuit.orbit);
  if (!pursuit.reason.empty() || fitting.steps == few) return;
  const int all = fitting.steps, some = 4 * static_cast<int>(std::sqrt(few * all) / 4);
  const Orbit first = copy_of(pursuit.at);
  const double change = (pursuit.orbit.period / period - 1) * first.period; // as the reduced model has it
  Owned<Vec> state = copy_of(first.state);
  if (all < 4 * few) return move_to(pursuit, state, first.period + change, all), shoot_on(pursuit);
  const double part = 1 / (1 + beyond(few, some, all));
  move_to(pursuit, state, first.period + part * change, some);
  shoot_on(pursuit);
  state = copy_of(pursuit.at.state);
  check(VecAXPBY(state, -beyond(few, some, all), 1 + beyond(few, some, all), first.state));
  move_to(pursuit, state, pursuit.at.period + beyond(few, some, all) * (pursuit.at.period - first.period), all);
  shoot_on(pursuit);
}

/// The cycle of the full model as far as it is wished for; says what is in the way.
std::string fit(Fitting& fitting, const ShootingStart& start, const Preconditioner& preconditioner, ReducedOrbit orbit)
{
  const double clock = MPI_Wtime();
  const Full& full = fitting.full;
  Fidelity& fidelity = fitting.result.fidelity;
  const double reduced_before = fidelity.reduced_seconds;
  PeriodMap map{full.structure, full.interface, fitting.steps, full.settings.theta};
  map.reactions = full.equilibrium.reactions;
  map.contact_tolerance = fidelity.contact_tolerance;
  const Flow flow = flow_of(map);
  Progress progress(comm_of(start.u), "cycle", 20);
  Shooting shooting = begin_shooting(flow, preconditioner, start, 0, progress);
  shooting.options.max_periods = fitting.options.corrections;
  Pursuit pursuit{fitting, map, shooting, {}, std::move(orbit)};
  const Owned<Vec> first = state_of(start.u, start.v);
  move_to(pursuit, first, start.period, fitting.steps);
  if (fidelity.asked == "auto")
    pursue(pursuit);
  else
  {
    judge(shooting, pursuit.at, next_step(shooting, pursuit.at));
    (void)choose_steps(fitting, pursuit.orbit);
  }

  LimitCycle& cycle = fitting.result.cycle;
  cycle.period = pursuit.at.period;
  cycle.start = {copy_of(displacement(pursuit.at.state)), copy_of(velocity(pursuit.at.state)), 0, {}};
  cycle.steps_per_period = fitting.steps;
  cycle.theta = map.theta;
  cycle.newton_iterations = shooting.iterations;
  cycle.periods_integrated = shooting.periods;
  cycle.records = shooting.records;
  cycle.residual_projected = std::nan("");
  cycle.residual_full = pursuit.at.residual;
  cycle.outcome = {"converged", "", shooting.iterations, pursuit.at.residual};
  (void)measure(map, full.equilibrium, full.probes, 32, cycle);
  fidelity.steps_per_period = fitting.steps;
  fidelity.full_periods = cycle.periods_integrated;
  fidelity.frequency_error = shooting.to_come.frequency;
  fidelity.energy_error = shooting.to_come.energy;
  fidelity.full_seconds += MPI_Wtime() - clock - (fidelity.reduced_seconds - reduced_before);
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
  if (fitting.result.fidelity.asked != "full") return fit(fitting, start, preconditioner, std::move(orbit));
  fitting.result.cycle = shoot_at_model(full.structure, full.interface, full.equilibrium, start, preconditioner,
                                        full.settings, 0, full.probes);
  return {};
}

} // namespace

FittedCycle find_fitted_cycle(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                              const Modes& modes, const Estimate& estimate, const CycleSettings& settings,
                              const std::string& asked, double accuracy, Mat probes)
{
  const auto unstable = static_cast<std::size_t>(std::max(modes.unstable_count, 1));
  const Full full{structure, interface, equilibrium, modes.modes, std::span(modes.modes).first(unstable),
                  estimate,  settings,  probes};
  const bool adaptive = asked == "auto", from_reduced = starts_reduced() && asked == "full";
  Fitting fitting(full);
  fitting.steps = adaptive ? std::min(64, settings.steps_per_period) : settings.steps_per_period;
  fitting.tolerance = from_reduced ? 1e-3 : 3e-4 * accuracy; // a start need not be better; slow motions multiply it
  FittedCycle& result = fitting.result;
  Fidelity& fidelity = result.fidelity;
  fidelity.asked = asked;
  fidelity.accuracy = accuracy;
  if (asked != "full" || from_reduced)
  {
    fidelity.used = from_reduced ? "full" : "reduced";
    fidelity.contact_tolerance = 1e-3 * accuracy;
    fidelity.reason = by_reduced_model(fitting);
    if (fidelity.reason.empty())
    {
      if (!settings.save_state.empty()) write_state(result.cycle.start, structure, settings.save_state);
      return std::move(result);
    }
  }
  if (asked == "reduced")
  {
    result.cycle.outcome.word = unstable > 1 ? "refused" : "not converged";
    result.cycle.outcome.reason = fidelity.reason;
    return std::move(result);
  }
  fidelity.used = "full"; // of whose errors nothing is known
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
