#include "squeal/cycle/limit_cycle.hpp"
#include "squeal/base/checkpoint.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/cycle/floquet.hpp"
#include "squeal/equilibrium/state.hpp"
#include "squeal/shooting/secants.hpp"

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
  check(VecAXPY(moved, -1, velocity(start)));
  return norm_of(moved, NORM_2) <= near * norm_of(velocity(start), NORM_2);
}

void describe_orbit(Checkpoint& checkpoint, const Structure& structure, const std::array<Vec, 2>& state, double& period)
{
  const FileOrder order(structure);
  for (const Vec part : state) order.describe(checkpoint, part);
  describe(checkpoint, period);
}

} // namespace

std::optional<GivenStart> kept_cycle(const Structure& structure)
{
  GivenStart orbit{{zeros_like(structure.load), zeros_like(structure.load), 0, {}}, 0, 1, true};
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

/// The energy norm of a state about the equilibrium.
double fluctuation_norm(const CycleProblem& problem, const State& state)
{
  const Owned<Vec> moved = copy_of(state.u.get());
  check(VecAXPY(moved, -1, problem.sliding.equilibrium.u));
  return std::sqrt(
      2 * (potential_energy(problem.sliding.structure, moved) + kinetic_energy(problem.sliding.structure, state.v)));
}

/// The energy norm of the followed mode at an amplitude of 1.
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

// How far a cycle's period and energy spread over the offsets that its joints may keep (src/README.md, section 6.13).

/// A cycle on its map, and what another one is found by.
struct CycleAtOffsets
{
  PeriodMap& map;
  const OrbitProblem& problem;
  const ShootingOptions& options;
  ConvergenceLog& log;
  const Orbit& orbit;
  const MeasuredPeriod& measured;
};

/// The pairs that are moved, along one tangent of theirs.
struct MovedPairs
{
  std::vector<std::size_t> pairs;
  int contact = 0, direction = 0;
};

/// The held pairs of each contact, along each tangent.
std::vector<MovedPairs> movable(const Interface& interface, const std::vector<char>& held)
{
  std::vector<MovedPairs> all;
  for (std::size_t i = 0; i < held.size(); ++i)
    for (int k = 0; held[i] && k < interface.directions; ++k)
    {
      const auto contact = static_cast<int>(interface.friction.contact_of(i));
      const auto known = std::ranges::find_if(all, [&](const MovedPairs& one)
                                              { return one.contact == contact && one.direction == k; });
      (known == all.end() ? all.emplace_back(MovedPairs{{}, contact, k}) : *known).pairs.push_back(i);
    }
  return all;
}

/// Moves the end of a range to where the use of a pair's friction comes to `limit`, as it rises from here to there.
void shorten(double limit, double here, double there, double step, OffsetSpread& spread)
{
  const double slope = (there - here) / step;
  if (slope == 0) return;
  const double end = (limit - here) / slope;
  if (end >= 0)
    spread.greatest = std::min(spread.greatest, end);
  else
    spread.least = std::max(spread.least, end);
}

/// The spread from one cycle to another, `step` [m] apart.
OffsetSpread spread_between(const CycleAtOffsets& at, const Orbit& other, const MeasuredPeriod& there, double step)
{
  constexpr double unbounded = std::numeric_limits<double>::infinity();
  OffsetSpread spread{0, 0, -unbounded, unbounded};
  const JointUse &here = at.measured.joints, &use = there.joints;
  for (std::size_t i = 0; i < here.least.size(); ++i)
  {
    if (here.slipped[i / static_cast<std::size_t>(at.map.sliding.interface.directions)]) continue;
    shorten(1, here.greatest[i], use.greatest[i], step, spread);
    shorten(-1, here.least[i], use.least[i], step, spread);
  }
  spread.by_period = (other.period - at.orbit.period) / step;
  spread.by_energy = (there.mean_fluctuating_energy - at.measured.mean_fluctuating_energy) / step;
  return spread;
}

/// Moves the held pairs of each contact along each tangent, all of them alike, and shoots at the cycle there. The range
/// ends where the first of the pairs reaches its friction, by a line.
std::vector<OffsetSpread> spread_over_offsets(const CycleAtOffsets& at)
{
  constexpr double part = 0.01; // of the swing
  PeriodMap& map = at.map;
  const JointMotion motion = map.joints;
  const double step = part * motion.slip.swing;
  std::vector<OffsetSpread> spreads;
  for (const MovedPairs& moved : movable(map.sliding.interface, motion.held))
  {
    std::vector<double> offsets = motion.offsets;
    for (const std::size_t pair : moved.pairs)
      PairView<double>(offsets, map.sliding.interface.directions)
          .tangential(pair)[static_cast<std::size_t>(moved.direction)] += step;
    const Equilibrium rest = map.rest.at(map.sliding, map.options.factor, motion.offsets),
                      other = map.rest.at(map.sliding, map.options.factor, offsets);
    if (rest.outcome.kind != OutcomeKind::converged || other.outcome.kind != OutcomeKind::converged) continue;
    const Owned<Vec> start = copy_of(at.orbit.state.get());
    check(VecAXPBYPCZ(displacement(start), 1, -1, 1, other.u, rest.u));
    const StageResult found =
        shoot_once(at.problem, at.options, at.log, evaluate(at.problem, at.log, start, at.orbit.period));
    if (found.ending != StageEnding::converged || found.orbit.offsets.held != at.orbit.offsets.held) continue;
    const MeasuredPeriod there = measure_period(map, {}, found.orbit.period, found.orbit.state);
    spreads.push_back(spread_between(at, found.orbit, there, step));
    spreads.back().contact = moved.contact;
    spreads.back().direction = moved.direction;
  }
  return spreads;
}

} // namespace

LimitCycle find_cycle_from(CycleProblem& problem, const CycleOptions& options, const ShootingStart& start,
                           const ShootingSettings& settings)
{
  const int steps = problem.settings.steps_per_period;
  PeriodMap map{problem.sliding, problem.step, steps, problem.settings.theta};
  map.reactions = problem.sliding.equilibrium.reactions;
  map.keeps_step = is_dear(steps * work_of_step(problem.sliding.structure));
  Flow flow = flow_of(map);
  const Preconditioner preconditioner = recorded_preconditioner(problem, map);
  add_slow_motions(problem, map, steps_to_compare(problem.sliding.structure, steps), flow);
  keep_cycles_of(flow, problem.sliding.structure);
  LimitCycle cycle{shoot(flow, preconditioner, start, settings, options.shooting), steps, settings.tolerance,
                   problem.settings.theta};
  const Finally last_period = undisturbed();
  cycle.measured = measure_period(map, {problem.probes, options.samples}, cycle.orbit.period, cycle.orbit.state);
  ++cycle.convergence.periods;
  if (cycle.outcome.kind == OutcomeKind::converged && cycle.orbit.offsets.held > 0 &&
      whole_tangent_is_cheap(2. * dofs_of(cycle.orbit.state)))
  {
    Progress progress(comm_of(start.u), "cycle, offsets", 1);
    ConvergenceLog log{progress};
    const OrbitProblem found_again = problem_of(flow, preconditioner, start, problem.settings.tolerance);
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

std::optional<State> state_on_modes(const SlidingEquilibrium& sliding, const UnstableModes& unstable,
                                    const CycleSettings& settings)
{
  const Estimate& estimate = unstable.estimates.front();
  const bool alone = settings.start.kind == CycleStartKind::mode;
  double amplitude = estimate.start_amplitude;
  if (alone) amplitude = settings.amplitude > 0 ? settings.amplitude : 2 * limiting_event(estimate);
  if (!(amplitude > 0) || !std::isfinite(amplitude)) return {};
  State start = mode_state(sliding.equilibrium, unstable.modes.front(), amplitude, estimate.phase);
  for (std::size_t i = 1; !alone && i < unstable.modes.size(); ++i)
    if (const auto motion = estimated_motion(sliding.equilibrium, unstable.modes[i], unstable.estimates[i]))
      add_motion(*motion, 1, start);
  return start;
}

double equivalent_amplitude(const CycleProblem& problem, const State& state)
{
  return fluctuation_norm(problem, state) / unit_norm(problem);
}

LimitCycle find_cycle_from_start(CycleProblem& problem, const CycleOptions& options)
{
  const ComplexMode& mode = problem.unstable.modes.front();
  const CycleSettings& settings = problem.settings;
  const Equilibrium& equilibrium = problem.sliding.equilibrium;
  if (!problem.start || mode.lambda.imag() == 0)
  {
    LimitCycle skipped;
    skipped.outcome = {OutcomeKind::skipped,
                       "no amplitude to start from: no energy balance and no lift-off, or no oscillation", 0,
                       std::nan("")};
    return skipped;
  }
  const auto& [state, period, rounds, resumed] = *problem.start;
  const bool is_cycle = period > 0; // it needs no free periods
  ShootingStart start{equilibrium.u,
                      state.u,
                      state.v,
                      is_cycle ? period : 1 / mode.frequency_hz(),
                      {mode.real, mode.imaginary, equilibrium.u},
                      problem.unstable.modes.size() - 1,
                      first_event(problem.unstable.estimates.front()) * unit_norm(problem),
                      is_cycle,
                      rounds};
  return find_cycle_from(problem, options, start,
                         {settings.tolerance, is_cycle ? 0 : settings.free_periods, 0, !is_cycle || resumed});
}

} // namespace squeal
