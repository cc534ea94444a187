#include "squeal/cycle/period_map.hpp"

#include <algorithm>

namespace squeal
{

void set_period(PeriodMap& map, double period)
{
  const double h = period / map.steps;
  if (h == map.step.h) return;
  map.step = make_theta_step(map.sliding.structure, map.sliding.interface, h, map.theta, map.options);
}

void complete_rate(PeriodMap& map, StepWork& work, State& end, Vec rate)
{
  const double half = 0.5 / map.step.h;
  map.reactions = end.reactions;
  (void)advance(map.step, map.sliding.structure, map.sliding.interface, work, end);
  check(VecAXPBY(displacement(rate), half, -half, end.u));
  check(VecAXPBY(velocity(rate), half, -half, end.v));
}

namespace
{

void integrate_period(PeriodMap& map, double period, Vec start, Vec end, Vec rate)
{
  const auto& [structure, interface, equilibrium] = map.sliding;
  set_period(map, period);
  State state{copy_of(displacement(start)), copy_of(velocity(start)), 0, map.reactions};
  StepWork work = begin_steps(map.step, structure, interface, state);
  for (int i = 0; i < map.steps; ++i)
  {
    if (rate && i + 1 == map.steps)
    {
      check(VecCopy(state.u, displacement(rate)));
      check(VecCopy(state.v, velocity(rate)));
    }
    if (!advance(map.step, structure, interface, work, state).contact_converged) ++map.unconverged;
  }
  check(VecCopy(state.u, displacement(end)));
  check(VecCopy(state.v, velocity(end)));
  if (rate) complete_rate(map, work, state, rate);
}

/// Several trajectories over one period, together as far as their memory allows.
void integrate_periods(PeriodMap& map, double period, std::span<const Vec> starts, std::span<const Vec> ends)
{
  constexpr std::size_t at_once = 16; // more gains nothing
  const auto& [structure, interface, equilibrium] = map.sliding;
  set_period(map, period);
  for (std::size_t first = 0; first < starts.size(); first += at_once)
  {
    const std::size_t count = std::min(at_once, starts.size() - first);
    std::vector<State> states;
    std::vector<StepWork> works;
    for (const Vec start : starts.subspan(first, count))
    {
      states.push_back({copy_of(displacement(start)), copy_of(velocity(start)), 0, map.reactions});
      works.push_back(begin_steps(map.step, structure, interface, states.back()));
    }
    for (int i = 0; i < map.steps; ++i)
      for (const StepReport& report : advance(map.step, structure, interface, works, states))
        if (!report.contact_converged) ++map.unconverged;
    for (std::size_t k = 0; k < count; ++k)
    {
      check(VecCopy(states[k].u, displacement(ends[first + k])));
      check(VecCopy(states[k].v, velocity(ends[first + k])));
    }
  }
}

} // namespace

Flow flow_of(PeriodMap& map)
{
  const auto integrate = [&map](double period, Vec start, Vec end, Vec rate)
  { integrate_period(map, period, start, end, rate); };
  const auto integrate_many = [&map](double period, std::span<const Vec> starts, std::span<const Vec> ends)
  { integrate_periods(map, period, starts, ends); };
  return {integrate, map.sliding.structure.M, map.sliding.structure.K, integrate_many};
}

} // namespace squeal
