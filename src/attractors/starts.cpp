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

/// The largest estimated displacement of an unstable mode: random motions are of its size.
double reference_amplitude(const UnstableModes& unstable)
{
  double amplitude = 0;
  for (const Estimate& estimate : unstable.estimates)
    if (std::isfinite(estimate.start_amplitude)) amplitude = std::max(amplitude, estimate.start_amplitude);
  return amplitude;
}

/// The sum of the least stable modes with random phases, each 0.1 to 2 times as large as the reference.
State random_start(const AttractorProblem& problem, std::mt19937_64& generator)
{
  State start = resting(problem.sliding.equilibrium);
  const double reference = reference_amplitude(problem.unstable);
  for (std::size_t i = 0; i < std::min(random_modes, problem.modes.size()); ++i)
  {
    const double factor = 0.1 * std::pow(20., uniform(generator)), phase = two_pi * uniform(generator);
    State motion = mode_state(problem.sliding.equilibrium, problem.modes[i], factor * reference, phase);
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
  return starts;
}

} // namespace squeal
