#include "starts.hpp"

#include "squeal/base/constants.hpp"
#include "squeal/base/random.hpp"

#include <algorithm>
#include <cmath>

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
/// event to four times the last one: what can attract is beyond the one, and may be beyond the other.
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

} // namespace

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

} // namespace squeal
