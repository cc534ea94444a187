#include "fitting.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

double step_error(const Fidelity& fidelity)
{
  return std::max(fidelity.step_frequency_error, fidelity.step_energy_error);
}

/// Of the step size, from the reduced cycle at twice and four times as many, and the order at which it falls: 1 where
/// impacts make it, 2 else. False without such cycles.
bool judge_steps(Fitting& fitting, const ReducedOrbit& orbit, double& order)
{
  Fidelity& fidelity = fitting.result.fidelity;
  const ReducedOrbit fine = shoot_reduced(fitting, orbit.state, orbit.period, 2 * fitting.steps);
  const ReducedOrbit finest = shoot_reduced(fitting, fine.state, fine.period, 4 * fitting.steps);
  fidelity.step_frequency_error = fidelity.step_energy_error = std::nan("");
  if (!fine.converged || !finest.converged) return false;
  const auto error = [&order](double coarse, double twice, double four_times)
  {
    const double first = std::abs(twice / coarse - 1), second = std::abs(four_times / twice - 1);
    order = std::clamp(std::log2(first / second), 1., 2.);
    return first / (1 - std::pow(2, -order));
  };
  fidelity.step_frequency_error = error(orbit.period, fine.period, finest.period);
  fidelity.step_energy_error = error(orbit.energy, fine.energy, finest.energy);
  return true;
}

/// Steps a period for which the step's error, of this order, is a third of the wish, and its growth rate's (omega
/// h)^2/4 the wish.
int steps_for(const Fidelity& fidelity, int steps, double order)
{
  const double measured = steps * std::pow(3 * step_error(fidelity) / fidelity.accuracy, 1 / order);
  const double theory = std::numbers::pi / std::sqrt(fidelity.accuracy);
  return 8 * static_cast<int>(std::ceil(std::max(measured, theory) / 8));
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

void move_to(Pursuit& pursuit, Vec state, double period)
{
  pursuit.map.steps = pursuit.fitting.steps;
  pursuit.at = evaluate(pursuit.shooting, state, period);
  record(pursuit.shooting, "full period", full_unknowns(pursuit.at), std::nan(""), pursuit.at);
}

/// As many steps a period as the wish needs; what they change in the reduced cycle is added to the full one.
void refine_steps(Pursuit& pursuit, double order)
{
  Fitting& fitting = pursuit.fitting;
  const int steps = std::max(fitting.steps, steps_for(fitting.result.fidelity, fitting.steps, order));
  if (steps == fitting.steps) return;
  ReducedOrbit fine = shoot_reduced(fitting, pursuit.orbit.state, pursuit.orbit.period, steps);
  if (!fine.converged)
  {
    pursuit.reason = "the reduced model has no cycle at " + std::to_string(steps) + " steps a period";
    return;
  }
  fitting.steps = steps;
  const Owned<Vec> change = motion_of(fitting.full, fitting.reduced.model,
                                      {fine.state.q - pursuit.orbit.state.q, fine.state.v - pursuit.orbit.state.v});
  check(VecAXPY(change, 1, pursuit.at.state));
  const double period = pursuit.at.period + fine.period - pursuit.orbit.period;
  pursuit.orbit = std::move(fine);
  move_to(pursuit, change, period);
}

/// Shoots until the wish is met by the model, then by the steps.
void pursue(Pursuit& pursuit)
{
  Fitting& fitting = pursuit.fitting;
  const Fidelity& fidelity = fitting.result.fidelity;
  double order = 0;
  for (bool rough = true; pursuit.reason.empty(); rough = false)
  {
    pursuit.shooting.wish = (rough ? 4 : .5) * fidelity.accuracy; // at first the steps are not what it needs
    Finish finish = shoot_multisecant(pursuit.shooting, pursuit.at);
    pursuit.at = std::move(finish.orbit);
    if (finish.ending != Ending::converged)
      pursuit.reason =
          "the wish was not met in " + std::to_string(pursuit.shooting.periods) + " periods of the full model";
    else if (!judge_steps(fitting, pursuit.orbit, order))
      pursuit.reason = "the reduced model has no cycle at two and four times as many steps a period";
    else if (!rough && step_error(fidelity) <= fidelity.accuracy / 2)
      return;
    else
      refine_steps(pursuit, rough ? 2 : order); // far from the limit an order is not seen yet
  }
}

/// The cycle of the full model as far as it is wished for; says what is in the way.
std::string fit(Fitting& fitting, const ShootingStart& start, const Preconditioner& preconditioner, ReducedOrbit orbit)
{
  const double clock = MPI_Wtime();
  const Full& full = fitting.full;
  Fidelity& fidelity = fitting.result.fidelity;
  PeriodMap map{full.structure, full.interface, fitting.steps, full.settings.theta};
  map.reactions = full.equilibrium.reactions;
  map.contact_tolerance = fidelity.contact_tolerance;
  const Flow flow = flow_of(map);
  Progress progress(comm_of(start.u), "cycle", 20);
  Shooting shooting = begin_shooting(flow, preconditioner, start, 0, progress);
  shooting.options.max_periods = fitting.options.corrections;
  Pursuit pursuit{fitting, map, shooting, {}, std::move(orbit)};
  const Owned<Vec> first = state_of(start.u, start.v);
  move_to(pursuit, first, start.period);
  if (fidelity.asked == "auto")
    pursue(pursuit);
  else
  {
    judge(shooting, pursuit.at, next_step(shooting, pursuit.at));
    double order = 0;
    (void)judge_steps(fitting, pursuit.orbit, order);
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
  fidelity.used = "full";
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
