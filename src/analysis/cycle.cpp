/// The brake's limit cycle: its period map by theta steps, the start from the energy estimate, and what is measured on
/// the last period.
#include "squeal/analysis/cycle.hpp"

#include "squeal/analysis/shooting.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace squeal
{

namespace
{

void integrate_period(PeriodMap& map, double period, Vec start, Vec end, Vec rate)
{
  const double h = period / map.steps;
  if (h != map.step.h)
  {
    map.step = make_theta_step(map.structure, map.interface, h, map.theta);
    ++map.factorings;
  }
  State state{copy_of(displacement(start)), copy_of(velocity(start)), 0, map.reactions};
  StepWork work = begin_steps(map.step, map.structure, map.interface, state);
  for (int i = 0; i < map.steps; ++i)
  {
    if (rate && i + 1 == map.steps)
    {
      check(VecCopy(state.u, displacement(rate)));
      check(VecCopy(state.v, velocity(rate)));
    }
    if (!advance(map.step, map.structure, map.interface, work, state).contact_converged) ++map.unconverged;
  }
  check(VecCopy(state.u, displacement(end)));
  check(VecCopy(state.v, velocity(end)));
  if (!rate) return;
  map.reactions = state.reactions;
  (void)advance(map.step, map.structure, map.interface, work, state);
  check(VecAXPBY(displacement(rate), 0.5 / h, -0.5 / h, state.u));
  check(VecAXPBY(velocity(rate), 0.5 / h, -0.5 / h, state.v));
}

double mean(const std::vector<double>& values)
{
  return std::accumulate(values.begin(), values.end(), 0.) / static_cast<double>(values.size());
}

/// One more period from the cycle's start, recorded.
void measure(PeriodMap& map, const Equilibrium& equilibrium, Mat probes, int samples, LimitCycle& cycle)
{
  State state = copy_of(cycle.start);
  state.reactions = map.reactions;
  if (map.step.h != cycle.period / map.steps)
    map.step = make_theta_step(map.structure, map.interface, cycle.period / map.steps, map.theta);
  int done = 0;
  const auto watch = [&](const State& now, const StepReport&, const StepWork&)
  {
    cycle.statuses.push_back(contact_status(map.interface, now.reactions));
    // evenly spread over the period whatever the two numbers
    if ((done + 1) * samples / map.steps > done * samples / map.steps) cycle.displacements.push_back(copy_of(now.u));
    ++done;
  };
  march(map.step, map.structure, map.interface, equilibrium, probes, map.steps, state, cycle.history, watch);
  ++cycle.periods_integrated;
  cycle.start.reactions = map.reactions;
  const History& history = cycle.history;
  if (history.energy.empty()) return;
  cycle.mean_energy = mean(history.energy);
  cycle.mean_fluctuating_energy = mean(history.fluctuating_energy);
  cycle.open_pairs_mean = mean({history.open.begin(), history.open.end()});
  cycle.open_pairs_max = *std::max_element(history.open.begin(), history.open.end());
  cycle.stick_pairs_max = *std::max_element(history.stick.begin(), history.stick.end());
  for (const auto& probe : history.probes)
  {
    const auto [least, largest] = std::minmax_element(probe.begin(), probe.end());
    cycle.peak_to_peak.push_back(*largest - *least);
  }
}

} // namespace

Flow flow_of(PeriodMap& map)
{
  const auto integrate = [&map](double period, Vec start, Vec end, Vec rate)
  { integrate_period(map, period, start, end, rate); };
  return {integrate, map.structure.M, map.structure.K};
}

LimitCycle find_cycle(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                      const ComplexMode& mode, const Estimate& estimate, const CycleSettings& settings, Mat probes)
{
  double lift_off_multiple = 2, band_factor = 3;
  PetscInt samples = 32;
  check(PetscOptionsGetReal(nullptr, "cycle_", "-lift_off_multiple", &lift_off_multiple, nullptr));
  check(PetscOptionsGetReal(nullptr, "cycle_", "-band_factor", &band_factor, nullptr));
  check(PetscOptionsGetInt(nullptr, "cycle_", "-samples", &samples, nullptr));
  if (samples < 1) throw Error("-cycle_samples must be at least 1");

  const bool balance = estimate.outcome.word == "balance";
  const double amplitude = balance ? estimate.amplitude : lift_off_multiple * estimate.lift_off_amplitude;
  if (!(amplitude > 0) || !std::isfinite(amplitude) || mode.lambda.imag() == 0)
  {
    LimitCycle skipped;
    skipped.outcome = {"skipped", "no amplitude to start from: no energy balance and no lift-off, or no oscillation", 0,
                       std::nan("")};
    return skipped;
  }
  const State first = mode_state(equilibrium, mode, amplitude, estimate.phase);
  const double frequency_hz = mode.frequency_hz();
  SlidingPreconditioner preconditioner;
  if (band_factor > 0)
    preconditioner =
        make_preconditioner(structure, interface, equilibrium,
                            find_real_modes_below(structure, interface, equilibrium, band_factor * frequency_hz),
                            settings.steps_per_period, settings.theta);
  PeriodMap map{structure, interface, settings.steps_per_period, settings.theta};
  map.reactions = equilibrium.reactions;
  const Flow flow = flow_of(map);
  const double event = std::min(estimate.lift_off_amplitude, estimate.reversal_amplitude) / amplitude;
  const Owned<Vec> moved = copy_of(first.u.get());
  check(VecAXPY(moved, -1, equilibrium.u));
  const double size = std::sqrt(2 * (potential_energy(structure, moved) + kinetic_energy(structure, first.v)));
  const ShootingStart start{
      equilibrium.u, first.u, first.v, 1 / frequency_hz, {mode.real, mode.imaginary, equilibrium.u}, event * size};
  LimitCycle cycle = shoot(flow, start, preconditioner, settings.tolerance, settings.free_periods);
  cycle.steps_per_period = settings.steps_per_period;
  cycle.theta = settings.theta;
  measure(map, equilibrium, probes, static_cast<int>(samples), cycle);
  if (map.step.law == ContactLaw::velocity && cycle.outcome.word != "converged")
    cycle.outcome.reason += "; by the velocity law the period map jumps where a step begins open or closed: "
                            "-transient_contact_law displacement";
  if (map.unconverged > 0)
    cycle.outcome.reason += (cycle.outcome.reason.empty() ? "" : "; ") + std::to_string(map.unconverged) +
                            " steps left the contact unconverged (-transient_contact_max_it)";
  if (!settings.save_state.empty()) write_state(cycle.start, structure, settings.save_state);
  return cycle;
}

} // namespace squeal
