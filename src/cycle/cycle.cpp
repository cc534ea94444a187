/// The brake's limit cycle: its period map by theta steps, the start from the energy estimate, and what is measured on
/// the last period.
#include "squeal/cycle/cycle.hpp"

#include "squeal/shooting/shooting.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace squeal
{

void set_period(PeriodMap& map, double period)
{
  const double h = period / map.steps;
  if (h == map.step.h) return;
  map.step = make_theta_step(map.structure, map.interface, h, map.theta);
  if (map.contact_tolerance > 0) map.step.contact.tolerance = map.contact_tolerance;
}

namespace
{

/// `rate` holds the state of a step before the period's end and becomes dPhi/dperiod there; `end` goes a step on.
void close_rate(PeriodMap& map, StepWork& work, State& end, Vec rate)
{
  const double half = 0.5 / map.step.h;
  map.reactions = end.reactions;
  (void)advance(map.step, map.structure, map.interface, work, end);
  check(VecAXPBY(displacement(rate), half, -half, end.u));
  check(VecAXPBY(velocity(rate), half, -half, end.v));
}

void integrate_period(PeriodMap& map, double period, Vec start, Vec end, Vec rate)
{
  set_period(map, period);
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
  close_rate(map, work, state, rate);
}

/// Several trajectories over one period, together as far as their memory allows.
void integrate_periods(PeriodMap& map, double period, std::span<const Vec> starts, std::span<const Vec> ends)
{
  constexpr std::size_t at_once = 16; // more gains nothing
  set_period(map, period);
  for (std::size_t first = 0; first < starts.size(); first += at_once)
  {
    const std::size_t count = std::min(at_once, starts.size() - first);
    std::vector<State> states;
    std::vector<StepWork> works;
    for (const Vec start : starts.subspan(first, count))
    {
      states.push_back({copy_of(displacement(start)), copy_of(velocity(start)), 0, map.reactions});
      works.push_back(begin_steps(map.step, map.structure, map.interface, states.back()));
    }
    for (int i = 0; i < map.steps; ++i)
      for (const StepReport& report : advance(map.step, map.structure, map.interface, works, states))
        if (!report.contact_converged) ++map.unconverged;
    for (std::size_t k = 0; k < count; ++k)
    {
      check(VecCopy(states[k].u, displacement(ends[first + k])));
      check(VecCopy(states[k].v, velocity(ends[first + k])));
    }
  }
}

double mean(const std::vector<double>& values)
{
  return std::accumulate(values.begin(), values.end(), 0.) / static_cast<double>(values.size());
}

} // namespace

State measure(PeriodMap& map, const Equilibrium& equilibrium, Mat probes, int samples, Vec rate, LimitCycle& cycle)
{
  cycle.start.reactions = map.reactions;
  State state = copy_of(cycle.start);
  const auto keep = [&](const State& now)
  {
    check(VecCopy(now.u, displacement(rate)));
    check(VecCopy(now.v, velocity(rate)));
  };
  if (rate) keep(state);
  set_period(map, cycle.period);
  int done = 0;
  const auto watch = [&](const State& now, const StepReport&, const StepWork&)
  {
    cycle.statuses.push_back(contact_status(map.interface, now.reactions));
    // evenly spread over the period whatever the two numbers
    if ((done + 1) * samples / map.steps > done * samples / map.steps) cycle.displacements.push_back(copy_of(now.u));
    if (++done + 1 == map.steps && rate) keep(now);
  };
  const MarchSummary summary =
      march(map.step, map.structure, map.interface, equilibrium, probes, map.steps, state, cycle.history, watch);
  map.unconverged += summary.unconverged;
  if (rate)
  {
    State after = copy_of(state);
    StepWork work = begin_steps(map.step, map.structure, map.interface, after);
    close_rate(map, work, after, rate);
  }
  cycle.factor_seconds = map.step.factor_seconds;
  cycle.condensed_seconds = map.step.condensed_seconds;
  ++cycle.periods_integrated;
  const History& history = cycle.history;
  if (history.energy.empty()) return state;
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
  return state;
}

Flow flow_of(PeriodMap& map)
{
  const auto integrate = [&map](double period, Vec start, Vec end, Vec rate)
  { integrate_period(map, period, start, end, rate); };
  const auto integrate_many = [&map](double period, std::span<const Vec> starts, std::span<const Vec> ends)
  { integrate_periods(map, period, starts, ends); };
  return {integrate, map.structure.M, map.structure.K, integrate_many};
}

namespace
{

struct StartOptions
{
  PetscReal amplitude = 1, phase = 0, period = 1, band_factor = 3; // [-], degrees, [-], [-]
  PetscInt samples = 32;
};

StartOptions read_options()
{
  StartOptions options;
  options.amplitude = start_amplitude_factor();
  check(PetscOptionsGetReal(nullptr, "cycle_", "-start_phase", &options.phase, nullptr));
  check(PetscOptionsGetReal(nullptr, "cycle_", "-start_period", &options.period, nullptr));
  check(PetscOptionsGetReal(nullptr, "cycle_", "-band_factor", &options.band_factor, nullptr));
  check(PetscOptionsGetInt(nullptr, "cycle_", "-samples", &options.samples, nullptr));
  if (!(options.period > 0)) throw Error("-cycle_start_period must be above 0");
  if (options.samples < 1) throw Error("-cycle_samples must be at least 1");
  return options;
}

double fluctuation_norm(const Structure& structure, const Equilibrium& equilibrium, const State& state)
{
  const Owned<Vec> moved = copy_of(state.u.get());
  check(VecAXPY(moved, -1, equilibrium.u));
  return std::sqrt(2 * (potential_energy(structure, moved) + kinetic_energy(structure, state.v)));
}

} // namespace

double start_amplitude_factor()
{
  PetscReal factor = 1;
  check(PetscOptionsGetReal(nullptr, "cycle_", "-start_amplitude", &factor, nullptr));
  if (!(factor > 0)) throw Error("-cycle_start_amplitude must be above 0");
  return factor;
}

LimitCycle shoot_at_model(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                          const ShootingStart& start, const Preconditioner& preconditioner,
                          const CycleSettings& settings, int free_periods, Mat probes)
{
  PeriodMap map{structure, interface, settings.steps_per_period, settings.theta};
  map.reactions = equilibrium.reactions;
  LimitCycle cycle = shoot(flow_of(map), start, preconditioner, settings.tolerance, free_periods);
  cycle.steps_per_period = settings.steps_per_period;
  cycle.theta = settings.theta;
  (void)measure(map, equilibrium, probes, static_cast<int>(read_options().samples), nullptr, cycle);
  if (map.step.law == ContactLaw::velocity && cycle.outcome.kind != OutcomeKind::converged)
    cycle.outcome.reason += "; by the velocity law the period map jumps where a step begins open or closed: "
                            "-transient_contact_law displacement";
  if (map.unconverged > 0)
    cycle.outcome.reason += (cycle.outcome.reason.empty() ? "" : "; ") + std::to_string(map.unconverged) +
                            " steps left the contact unconverged (-transient_contact_max_it)";
  if (!settings.save_state.empty()) write_state(cycle.start, structure, settings.save_state);
  return cycle;
}

LimitCycle find_cycle(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                      std::span<const ComplexMode> unstable, const Estimate& estimate, const CycleSettings& settings,
                      Mat probes)
{
  const StartOptions options = read_options();
  const ComplexMode& mode = unstable.front();
  const double amplitude = options.amplitude * start_amplitude(estimate);
  if (!(amplitude > 0) || !std::isfinite(amplitude) || mode.lambda.imag() == 0)
  {
    LimitCycle skipped;
    skipped.outcome = {OutcomeKind::skipped,
                       "no amplitude to start from: no energy balance and no lift-off, or no oscillation", 0,
                       std::nan("")};
    return skipped;
  }
  State first = mode_state(equilibrium, mode, amplitude, estimate.phase + options.phase * std::numbers::pi / 180);
  const double frequency_hz = mode.frequency_hz();
  Preconditioner preconditioner;
  if (options.band_factor > 0)
    preconditioner = sliding_preconditioner(
        structure, interface, equilibrium,
        find_real_modes_below(structure, interface, equilibrium, options.band_factor * frequency_hz),
        settings.steps_per_period, settings.theta);
  const double first_event = std::min(estimate.lift_off_amplitude, estimate.reversal_amplitude) / amplitude *
                             fluctuation_norm(structure, equilibrium, first);
  ShootingStart start{
      equilibrium.u, first.u, first.v, options.period / frequency_hz, {mode.real, mode.imaginary, equilibrium.u}, {},
      first_event};
  for (const State& motion : estimated_motions(structure, interface, equilibrium, unstable.subspan(1)))
  {
    add_motion(motion, options.amplitude, first);
    start.asleep.push_back(state_of(motion.u, motion.v));
  }
  return shoot_at_model(structure, interface, equilibrium, start, preconditioner, settings, settings.free_periods,
                        probes);
}

} // namespace squeal
