#include "squeal/cycle/limit_cycle.hpp"

#include "floquet.hpp"
#include "preconditioner.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

/// Of the state about the equilibrium, in the energy norm.
double fluctuation_norm(const CycleProblem& problem, const State& state)
{
  const Owned<Vec> moved = copy_of(state.u.get());
  check(VecAXPY(moved, -1, problem.sliding.equilibrium.u));
  return std::sqrt(
      2 * (potential_energy(problem.sliding.structure, moved) + kinetic_energy(problem.sliding.structure, state.v)));
}

/// Adds to the reason of an outcome what the brake's options can do about it.
void add_remedies(const PeriodMap& map, Outcome& outcome)
{
  if (outcome.kind == OutcomeKind::unstable_cycle) outcome.reason += " (-cycle_start_amplitude, cycle.free_periods)";
  if (map.step.law == ContactLaw::velocity && outcome.kind != OutcomeKind::converged)
    outcome.reason += "; by the velocity law the period map jumps where a step begins open or closed: "
                      "-transient_contact_law displacement";
  if (map.unconverged > 0)
    outcome.reason += (outcome.reason.empty() ? "" : "; ") + std::to_string(map.unconverged) +
                      " steps left the contact unconverged (-transient_contact_max_it)";
}

} // namespace

LimitCycle find_cycle_from(const CycleProblem& problem, const CycleOptions& options, const ShootingStart& start,
                           const Preconditioner& preconditioner, int free_periods)
{
  const CycleSettings& settings = problem.settings;
  PeriodMap map{problem.sliding, problem.step, settings.steps_per_period, settings.theta};
  map.reactions = problem.sliding.equilibrium.reactions;
  Flow flow = flow_of(map);
  add_slow_motions(problem, map, steps_to_compare(problem.sliding.structure, map.steps), flow);
  ShootingResult found = shoot(flow, preconditioner, start, {settings.tolerance, free_periods}, options.shooting);
  LimitCycle cycle{std::move(found.outcome),
                   settings.steps_per_period,
                   settings.tolerance,
                   settings.theta,
                   std::move(found.orbit),
                   std::move(found.convergence),
                   std::move(found.multipliers),
                   {},
                   {}};
  cycle.measured = measure_period(map, {problem.probes, static_cast<int>(options.samples)}, cycle.orbit.period,
                                  cycle.orbit.state, nullptr);
  ++cycle.convergence.periods;
  cycle.costs = {map.step.factor_seconds, map.step.condensed_seconds};
  add_remedies(map, cycle.outcome);
  return cycle;
}

LimitCycle find_cycle_from_estimate(const CycleProblem& problem, const CycleOptions& options)
{
  const ComplexMode& mode = problem.unstable.modes.front();
  const Estimate& estimate = problem.unstable.estimates.front();
  const Equilibrium& equilibrium = problem.sliding.equilibrium;
  const double amplitude = options.start_amplitude * estimate.start_amplitude;
  if (!(amplitude > 0) || !std::isfinite(amplitude) || mode.lambda.imag() == 0)
  {
    LimitCycle skipped;
    skipped.outcome = {OutcomeKind::skipped,
                       "no amplitude to start from: no energy balance and no lift-off, or no oscillation", 0,
                       std::nan("")};
    return skipped;
  }
  State first = mode_state(equilibrium, mode, amplitude, estimate.phase + options.start_phase * std::numbers::pi / 180);
  const double first_event =
      std::min(estimate.lift_off_amplitude, estimate.reversal_amplitude) / amplitude * fluctuation_norm(problem, first);
  ShootingStart start{equilibrium.u,
                      first.u,
                      first.v,
                      options.start_period / mode.frequency_hz(),
                      {mode.real, mode.imaginary, equilibrium.u},
                      {},
                      first_event};
  for (std::size_t i = 1; i < problem.unstable.modes.size(); ++i)
  {
    const auto motion = estimated_motion(equilibrium, problem.unstable.modes[i], problem.unstable.estimates[i]);
    if (!motion) continue;
    add_motion(*motion, options.start_amplitude, first);
    start.other_unstable.push_back(state_of(motion->u, motion->v));
  }
  return find_cycle_from(problem, options, start, estimated_preconditioner(problem, options.band_factor),
                         problem.settings.free_periods);
}

} // namespace squeal
