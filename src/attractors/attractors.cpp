#include "squeal/attractors/attractors.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/base/statistics.hpp"
#include "squeal/transient/theta_step.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

namespace squeal
{

namespace
{

constexpr std::size_t random_modes = 6; // the least stable ones

State resting(const Equilibrium& equilibrium)
{
  return {copy_of(equilibrium.u.get()), zeros_like(equilibrium.u), 0, equilibrium.reactions};
}

/// Amplitudes of modes in random motions. [m]
struct AmplitudeRange
{
  double least = 0, ratio = 1; // of the greatest to the least
};

/// A tenth to twice the largest estimate of an unstable mode. Beside an equilibrium that is stable, half the first
/// event to four times the last one. What can attract is beyond the first, and may be beyond the last.
AmplitudeRange amplitude_range(const UnstableModes& unstable)
{
  double amplitude = 0;
  for (const Estimate& estimate : unstable.estimates)
    if (std::isfinite(estimate.start_amplitude)) amplitude = std::max(amplitude, estimate.start_amplitude);
  const Estimate& first = unstable.estimates.front();
  if (unstable.modes.front().growth_rate() > 0 || !std::isfinite(first_event(first))) return {0.1 * amplitude, 20};
  double last = 0;
  for (const double event : {first.lift_off_amplitude, first.reversal_amplitude})
    if (std::isfinite(event)) last = std::max(last, event);
  return {0.5 * first_event(first), 8 * last / first_event(first)};
}

/// The sum of the least stable modes with random phases and amplitudes.
State random_start(const AttractorProblem& problem, std::mt19937_64& generator)
{
  State start = resting(problem.sliding.equilibrium);
  const auto [least, ratio] = amplitude_range(problem.unstable);
  for (std::size_t i = 0; i < std::min(random_modes, problem.modes.size()); ++i)
  {
    const double amplitude = least * std::pow(ratio, uniform(generator)), phase = two_pi * uniform(generator);
    State motion = mode_state(problem.sliding.equilibrium, problem.modes[i], amplitude, phase);
    check(VecAXPY(motion.u, -1, problem.sliding.equilibrium.u));
    add_motion(motion, 1, start);
  }
  return start;
}

struct NamedStart
{
  std::string name;
  State state;
};

/// Each unstable mode at its estimate, pairs of them, and random sums of modes up to the number asked for. The small
/// motion follows where it is asked for.
std::vector<NamedStart> make_starts(const AttractorProblem& problem)
{
  const Equilibrium& equilibrium = problem.sliding.equilibrium;
  const auto wanted = static_cast<std::size_t>(problem.settings.starts);
  std::vector<NamedStart> starts;
  const auto add = [&](const std::string& name, std::initializer_list<std::size_t> numbers)
  {
    if (starts.size() >= wanted) return;
    State state = resting(equilibrium);
    for (const std::size_t i : numbers)
    {
      const auto motion = estimated_motion(equilibrium, problem.unstable.modes[i], problem.unstable.estimates[i]);
      if (!motion) return;
      add_motion(*motion, 1, state);
    }
    starts.push_back({name, std::move(state)});
  };
  const std::size_t count = problem.unstable.modes.size();
  for (std::size_t i = 0; i < count; ++i) add(format("mode %zu", i + 1), {i});
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = i + 1; j < count; ++j) add(format("modes %zu and %zu", i + 1, j + 1), {i, j});
  std::mt19937_64 generator(1); // equal runs draw equal starts
  for (int number = 1; starts.size() < wanted; ++number)
    starts.push_back({format("random %d", number), random_start(problem, generator)});
  const double event = first_event(problem.unstable.estimates.front());
  if (problem.from_small && event > 0 && std::isfinite(event)) // smaller motions come through its state
    starts.push_back({"growth of mode 1", mode_state(equilibrium, problem.unstable.modes.front(), event / 2, 0)});
  return starts;
}

bool agree(const MeanValue& a, const MeanValue& b, double relative)
{
  return std::abs(a.value - b.value) <= a.error + b.error + relative * std::max(std::abs(a.value), std::abs(b.value));
}

} // namespace

MeanValue frequency_of(const std::vector<double>& crossings)
{
  const std::size_t count = crossings.size();
  if (count < 8) return {};
  const auto between = [&](std::size_t first, std::size_t last)
  { return static_cast<double>(last - first) / (crossings[last] - crossings[first]); };
  const std::size_t half = count / 2, quarter = (half + count - 1) / 2;
  return {between(half, count - 1), std::abs(between(half, quarter) - between(quarter, count - 1))};
}

bool agree(const ReachedMotion& a, const ReachedMotion& b)
{
  return agree(a.energy, b.energy, 0.01) && agree(a.frequency, b.frequency, 1e-3);
}

bool is_cycle(const ReachedMotion& motion, const MeanValue& energy, const MeanValue& frequency)
{
  const double times = std::max(1., std::round(motion.frequency.value / frequency.value));
  return agree(motion, {motion.kind, energy, {times * frequency.value, times * frequency.error}, {}});
}

ReachedMotion reached_by(const std::vector<double>& energies, const std::vector<double>& crossings, double rest)
{
  constexpr double within = 0.005; // of the mean
  ReachedMotion reached;
  if (energies.empty()) return reached;
  const auto half = std::span(energies).last((energies.size() + 1) / 2);
  reached.energy = batch_mean(half);
  reached.frequency = frequency_of(crossings);
  if (energies.size() < 20)
  {
    const auto [least, most] = std::ranges::minmax(half);
    reached.energy.error = most - least;
    return reached;
  }
  const MeanValue decay = decay_of_spread(half);
  const double to_a_half = std::log(2.) / static_cast<double>(half.size()); // within the window
  const bool is_steady = reached.energy.error < within * reached.energy.value;
  if (energies.back() < rest)
    reached = {ReachedKind::rest, reached.energy, {}, {}};
  else if (is_stationary(half) && (is_steady || decay.value <= std::max(decay.error, to_a_half)))
    reached.kind = is_steady ? ReachedKind::steady : ReachedKind::varying;
  return reached;
}

std::vector<ReachedMotion> joined(std::vector<ReachedMotion> motions)
{
  std::vector<ReachedMotion> list;
  for (ReachedMotion& motion : motions)
  {
    const auto is_same = [&](const ReachedMotion& other)
    { return motion.kind == other.kind && (motion.kind == ReachedKind::rest || agree(motion, other)); };
    const auto known = std::ranges::find_if(list, is_same);
    if (known == list.end())
      list.push_back(std::move(motion));
    else
      known->starts.insert(known->starts.end(), motion.starts.begin(), motion.starts.end());
  }
  std::stable_sort(list.begin(), list.end(),
                   [](const ReachedMotion& a, const ReachedMotion& b) { return a.starts.size() > b.starts.size(); });
  return list;
}

namespace
{

constexpr long most_periods = 400;
constexpr int block = 50;              // periods between two looks at the energies
constexpr double at_rest = 1e-4;       // of the least energy of a start
constexpr std::size_t coordinates = 4; // of the least stable modes

/// A trajectory as it is seen.
struct Watched
{
  State state;                    // where it is
  std::vector<double> energies{}; // [J] fluctuating, of each step
  bool slides = false;            // all pairs of the equilibrium did, in each step of the last periods
  std::array<double, coordinates> last{}, squares{};
  std::array<std::vector<double>, coordinates> crossings{}; // [s] upwards through zero
};

/// Trajectories at one number of steps a period.
struct Swarm
{
  const AttractorProblem& problem;
  int steps_per_period;
  ThetaStep step;
  std::vector<Vec> shapes{}; // of the modes whose coordinates are watched
  std::vector<Watched> motions{};
};

Swarm begin(const AttractorProblem& problem, int steps_per_period, std::vector<State> starts)
{
  const double period = 1 / problem.unstable.modes.front().frequency_hz();
  Swarm swarm{problem, steps_per_period,
              make_theta_step(problem.sliding.structure, problem.sliding.interface, period / steps_per_period,
                              problem.settings.theta, problem.step)};
  for (std::size_t i = 0; i < std::min(coordinates, problem.modes.size()); ++i)
    swarm.shapes.push_back(problem.modes[i].real);
  for (State& start : starts) swarm.motions.push_back({std::move(start)});
  return swarm;
}

/// Notes the velocities along the modes.
void watch(const Swarm& swarm, double time, Vec Mv, Watched& watched)
{
  std::array<double, coordinates> now{};
  check(VecMDot(Mv, static_cast<PetscInt>(swarm.shapes.size()), swarm.shapes.data(), now.data()));
  for (std::size_t i = 0; i < swarm.shapes.size(); ++i)
  {
    watched.squares[i] += now[i] * now[i];
    if (watched.last[i] < 0 && now[i] >= 0)
      watched.crossings[i].push_back(time - swarm.step.h * now[i] / (now[i] - watched.last[i]));
  }
  watched.last = now;
}

/// Integrates every motion for so many periods more.
void integrate(Swarm& swarm, long periods)
{
  const auto closed = static_cast<int>(std::ranges::count(swarm.problem.sliding.equilibrium.closed, true));
  for (Watched& watched : swarm.motions)
  {
    History history;
    const auto monitor = [&](const State& now, const StepReport&, const StepWork& work)
    { watch(swarm, now.time, work.Mv, watched); };
    if (march(swarm.step, swarm.problem.sliding, periods * swarm.steps_per_period, watched.state,
              {nullptr, history, monitor})
            .interrupted)
      throw Interrupted{};
    watched.energies.insert(watched.energies.end(), history.fluctuating_energy.begin(),
                            history.fluctuating_energy.end());
    watched.slides = std::ranges::all_of(history.slip, [closed](int slipping) { return slipping == closed; });
  }
}

std::vector<ReachedMotion> reached(const Swarm& swarm)
{
  // sliding that small motions do not leave decays to rest, unless friction bends with the speed
  const auto bends = [](const FrictionLaw& law) { return depends_on_speed(law) && !has_two_levels(law); };
  const bool falls = swarm.problem.unstable.modes.front().growth_rate() < 0 &&
                     !any_law(swarm.problem.sliding.interface.friction, bends);
  double least = HUGE_VAL;
  for (const Watched& watched : swarm.motions) least = std::min(least, watched.energies.front());
  std::vector<ReachedMotion> motions;
  for (const Watched& watched : swarm.motions)
  {
    const auto moving = std::ranges::max_element(watched.squares) - watched.squares.begin();
    const std::vector<double>& crossings = watched.crossings[static_cast<std::size_t>(moving)];
    const double frequency = frequency_of(crossings).value,
                 period = frequency > 0 ? 2 / frequency / swarm.step.h : swarm.steps_per_period; // some cross twice
    motions.push_back(reached_by(means_over(watched.energies, period), crossings, at_rest * least));
    if (falls && watched.slides) motions.back() = {ReachedKind::rest, motions.back().energy, {}, {}};
    motions.back().starts = {motions.size() - 1};
  }
  return motions;
}

/// After so many periods. That no cycle attracts is not said of a short motion: it may still be on its way to one.
bool all_settled(const std::vector<ReachedMotion>& motions, long periods)
{
  const bool is_short = periods < 200;
  return std::none_of(motions.begin(), motions.end(),
                      [&](const ReachedMotion& motion) {
                        return motion.kind == ReachedKind::unsettled ||
                               (is_short && motion.kind == ReachedKind::varying);
                      });
}

/// Adds to the bars of motions what half as many steps a period change. Each is marched from where its first start has
/// ended, over as many periods. One step more keeps motions that each take a whole number of steps from agreeing.
/// One whose periods are alike to rounding takes such a number, and holds half a step.
void add_step_errors(const Swarm& swarm, long periods, std::vector<ReachedMotion>& motions)
{
  std::vector<ReachedMotion*> moving;
  std::vector<State> ends;
  for (ReachedMotion& motion : motions)
  {
    if (motion.kind == ReachedKind::rest) continue;
    moving.push_back(&motion);
    State end = copy_of(swarm.motions[motion.starts.front()].state);
    end.time = 0;
    ends.push_back(std::move(end));
  }
  if (moving.empty()) return;
  Swarm coarse = begin(swarm.problem, swarm.steps_per_period / 2 + 1, std::move(ends));
  integrate(coarse, periods);
  const std::vector<ReachedMotion> others = reached(coarse);
  for (std::size_t k = 0; k < moving.size(); ++k)
  {
    moving[k]->energy.error += std::abs(others[k].energy.value - moving[k]->energy.value);
    constexpr double rounding = 1e-9;
    if (const double f = moving[k]->frequency.value; moving[k]->frequency.error < rounding * f)
      moving[k]->frequency.error += f * f * swarm.step.h / 2;
    moving[k]->frequency.error += std::abs(others[k].frequency.value - moving[k]->frequency.value);
  }
}

} // namespace

Attractors find_attractors(const AttractorProblem& problem)
{
  Attractors found;
  const int steps = problem.settings.steps_per_period;
  const std::string refusal =
      friction_refusal(problem.sliding, &problem.unstable.modes.front(), problem.settings.theta,
                       1 / (problem.unstable.modes.front().frequency_hz() * steps), problem.step, 1);
  if (!refusal.empty()) return {{OutcomeKind::refused, refusal, 0, 0}, {}, {}, 0};
  std::vector<State> states;
  for (NamedStart& start : make_starts(problem))
  {
    found.starts.push_back(start.name);
    states.push_back(std::move(start.state));
  }
  if (states.empty()) return {{OutcomeKind::skipped, "no amplitude is known that contact limits", 0, 0}, {}, {}, 0};
  Swarm swarm = begin(problem, steps, std::move(states));
  Progress progress(comm_of(problem.sliding.structure.load), "attractors", static_cast<double>(most_periods));
  std::vector<ReachedMotion> motions;
  for (long target = block;; target += block) // of periods, after which the energies are looked at
  {
    integrate(swarm, block);
    found.periods = target;
    motions = reached(swarm);
    progress.update(static_cast<double>(target), format("%ld periods", target));
    if (all_settled(motions, target) || target + block > most_periods) break;
  }
  const bool settled = all_settled(motions, std::numeric_limits<long>::max());
  found.motions = joined(std::move(motions));
  add_step_errors(swarm, found.periods, found.motions);
  found.motions = joined(std::move(found.motions)); // motions that differ by less than these errors
  found.outcome = {settled ? OutcomeKind::completed : OutcomeKind::not_converged,
                   settled ? "" : format("some motions had not settled after %ld periods", found.periods), 0, 0};
  return found;
}

} // namespace squeal
