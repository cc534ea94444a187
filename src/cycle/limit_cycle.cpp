#include "squeal/cycle/limit_cycle.hpp"
#include "offset_spread.hpp"
#include "squeal/base/checkpoint.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/cycle/floquet.hpp"
#include "squeal/cycle/preconditioner.hpp"
#include "squeal/equilibrium/state.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

namespace squeal
{

namespace
{

constexpr const char* name_of_file = "cycle";

/// Whether a period comes back to its start within a hundredth, by velocities: Newton's method then stays with the
/// cycle that the search is led to.
bool is_near(Vec start, Vec end)
{
  constexpr double near = 0.01;
  const Owned<Vec> moved = copy_of(velocity(end));
  double first = 0, by = 0;
  check(VecAXPY(moved, -1, velocity(start)));
  check(VecNorm(velocity(start), NORM_2, &first));
  check(VecNorm(moved, NORM_2, &by));
  return by <= near * first;
}

void describe_orbit(Checkpoint& checkpoint, const Structure& structure, const std::array<Vec, 2>& state, double& period)
{
  const FileOrder order(structure);
  for (const Vec part : state) order.describe(checkpoint, part);
  describe(checkpoint, period);
}

} // namespace

std::optional<ResumedOrbit> kept_cycle(const Structure& structure)
{
  ResumedOrbit orbit{{zeros_like(structure.load), zeros_like(structure.load), 0, {}}};
  const auto describe = [&](Checkpoint& checkpoint) {
    describe_orbit(checkpoint, structure, {orbit.state.u, orbit.state.v}, orbit.period);
  };
  if (!restore(name_of_file, comm_of(structure.load), describe)) return {};
  return orbit;
}

void keep_cycle(const Structure& structure, Vec start, double period)
{
  keep(name_of_file, comm_of(structure.load),
       [&](Checkpoint& checkpoint) {
         describe_orbit(checkpoint, structure, {displacement(start), velocity(start)}, period);
       });
}

void keep_cycles_of(Flow& flow, const Structure& structure)
{
  struct Near // the last orbit near a cycle
  {
    Owned<Vec> start; // null: none was met
    double period = 0;
  };
  const auto near = std::make_shared<Near>();
  const auto keep = [near, &structure]
  {
    if (near->start.get()) keep_cycle(structure, near->start, near->period);
  };
  flow.integrate = [near, keep, integrate = std::move(flow.integrate)](double period, Vec start, Vec end, Vec rate)
  {
    try
    {
      integrate(period, start, end, rate);
    }
    catch (const Interrupted&)
    {
      keep();
      throw;
    }
    if (rate && is_near(start, end)) *near = {copy_of(start), period};
    if (checkpoint_is_due()) keep();
  };
  if (!flow.apply_tangent) return;
  flow.apply_tangent = [keep, apply = std::move(flow.apply_tangent)](std::span<const Vec> states)
  {
    apply(states);
    if (checkpoint_is_due()) keep();
  };
}

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

/// Of the followed mode at an amplitude of 1.
double unit_norm(const CycleProblem& problem)
{
  return fluctuation_norm(problem, mode_state(problem.sliding.equilibrium, problem.unstable.modes.front(), 1,
                                              problem.unstable.estimates.front().phase));
}

/// Adds to the reason of an outcome what the brake's options can do about it.
void add_remedies(const PeriodMap& map, Outcome& outcome)
{
  if (map.unconverged > 0)
    outcome.reason +=
        (outcome.reason.empty() ? "" : "; ") + std::to_string(map.unconverged) + " steps left the contact unconverged";
}

} // namespace

LimitCycle find_cycle_from(const CycleProblem& problem, const CycleOptions& options, const ShootingStart& start,
                           const Preconditioner* preconditioner, int free_periods)
{
  const CycleSettings& settings = problem.settings;
  PeriodMap map{problem.sliding, problem.step, settings.steps_per_period, settings.theta};
  map.reactions = problem.sliding.equilibrium.reactions;
  map.keeps_step = is_dear(map.steps * work_of_step(problem.sliding.structure));
  Flow flow = flow_of(map);
  std::shared_ptr<const ReducedModel> recorded;
  CycleProblem with_model = problem;
  const Preconditioner by_record = recorded_preconditioner(with_model, map, recorded),
                       &inverse = preconditioner ? *preconditioner : by_record;
  add_slow_motions(with_model, map, steps_to_compare(problem.sliding.structure, map.steps), flow);
  keep_cycles_of(flow, problem.sliding.structure);
  ShootingResult found = shoot(flow, inverse, start, {settings.tolerance, free_periods}, options.shooting);
  LimitCycle cycle{std::move(found.outcome),
                   settings.steps_per_period,
                   settings.tolerance,
                   settings.theta,
                   std::move(found.orbit),
                   std::move(found.convergence),
                   std::move(found.multipliers),
                   {},
                   {},
                   {},
                   found.cut_short};
  cycle.free = std::move(found.free);
  const Finally last_period = undisturbed();
  cycle.measured =
      measure_period(map, {problem.probes, options.samples}, cycle.orbit.period, cycle.orbit.state, nullptr);
  ++cycle.convergence.periods;
  if (cycle.outcome.kind == OutcomeKind::converged && cycle.orbit.offsets.held > 0 &&
      whole_tangent_is_cheap(2. * dofs_of(cycle.orbit.state)))
  {
    Progress progress(comm_of(start.u), "cycle, offsets", 1);
    ConvergenceLog log{progress};
    const OrbitProblem found_again = problem_of(flow, inverse, start, settings.tolerance);
    cycle.spreads = spread_over_offsets({map, found_again, options.shooting, log, cycle.orbit, cycle.measured});
  }
  cycle.costs = {map.step.factor_seconds, map.step.condensed_seconds};
  add_remedies(map, cycle.outcome);
  return cycle;
}

CycleProblem at_equilibrium(const CycleProblem& problem, const SlidingEquilibrium& sliding)
{
  return {sliding,          problem.linearised, problem.modes,         problem.unstable,
          problem.settings, problem.step,       problem.modes_options, problem.probes};
}

CycleProblem with_settings(CycleProblem problem, const CycleSettings& settings)
{
  problem.settings = settings;
  return problem;
}

std::vector<State> other_unstable_motions(const CycleProblem& problem)
{
  const UnstableModes& unstable = problem.unstable;
  std::vector<State> motions;
  for (std::size_t i = 1; i < unstable.modes.size(); ++i)
    if (auto motion = estimated_motion(problem.sliding.equilibrium, unstable.modes[i], unstable.estimates[i]))
      motions.push_back(std::move(*motion));
  return motions;
}

std::optional<State> cycle_start(const CycleProblem& problem)
{
  const CycleStartKind kind = problem.settings.start.kind;
  if (problem.given) return copy_of(*problem.given);
  const ComplexMode& mode = problem.unstable.modes.front();
  const Estimate& estimate = problem.unstable.estimates.front();
  double amplitude = estimate.start_amplitude;
  if (kind == CycleStartKind::mode)
    amplitude = problem.settings.amplitude > 0 ? problem.settings.amplitude : 2 * estimate.lift_off_amplitude;
  if (!(amplitude > 0) || !std::isfinite(amplitude)) return {};
  State start = mode_state(problem.sliding.equilibrium, mode, amplitude, estimate.phase);
  if (kind == CycleStartKind::mode) return start;
  for (const State& motion : other_unstable_motions(problem)) add_motion(motion, 1, start);
  return start;
}

double equivalent_amplitude(const CycleProblem& problem, const State& state)
{
  return fluctuation_norm(problem, state) / unit_norm(problem);
}

LimitCycle find_cycle_from_resumed(const CycleProblem& problem, const CycleOptions& options,
                                   const Preconditioner* preconditioner)
{
  const ResumedOrbit& orbit = *problem.resumed;
  ShootingStart start{problem.sliding.equilibrium.u, orbit.state.u, orbit.state.v, orbit.period};
  start.is_cycle = true;
  return find_cycle_from(problem, options, start, preconditioner, 0);
}

LimitCycle find_cycle_from_start(const CycleProblem& problem, const CycleOptions& options)
{
  if (problem.resumed) return find_cycle_from_resumed(problem, options, nullptr);
  const ComplexMode& mode = problem.unstable.modes.front();
  const Estimate& estimate = problem.unstable.estimates.front();
  const Equilibrium& equilibrium = problem.sliding.equilibrium;
  const std::optional<State> first = cycle_start(problem);
  if (!first || mode.lambda.imag() == 0)
  {
    LimitCycle skipped;
    skipped.outcome = {OutcomeKind::skipped,
                       "no amplitude to start from: no energy balance and no lift-off, or no oscillation", 0,
                       std::nan("")};
    return skipped;
  }
  const double limited_from = first_event(estimate) * unit_norm(problem);
  const bool is_cycle = problem.given_period > 0; // it needs no free periods
  ShootingStart start{equilibrium.u,
                      first->u,
                      first->v,
                      is_cycle ? problem.given_period : 1 / mode.frequency_hz(),
                      {mode.real, mode.imaginary, equilibrium.u},
                      {},
                      limited_from,
                      is_cycle,
                      problem.given_rounds};
  start.other_unstable = problem.unstable.modes.size() - 1;
  return find_cycle_from(problem, options, start, nullptr, is_cycle ? 0 : problem.settings.free_periods);
}

} // namespace squeal
