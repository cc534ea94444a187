#pragma once
/// Trajectories side by side, for the programs of tools/bench.
#include "squeal/transient/theta_step.hpp"

namespace squeal
{

struct Trajectories
{
  std::vector<State> states;
  std::vector<StepWork> works;
};

/// `count` trajectories from the start, whose velocities differ by thousandths.
inline Trajectories trajectories_from(const State& start, int count, const ThetaStep& step, const Structure& structure,
                                      const Interface& interface)
{
  Trajectories trajectories;
  for (int k = 0; k < count; ++k)
  {
    State& state = trajectories.states.emplace_back(copy_of(start));
    check(VecScale(state.v, 1 + k / 1000.));
    trajectories.works.push_back(begin_steps(step, structure, interface, state));
  }
  return trajectories;
}

} // namespace squeal
