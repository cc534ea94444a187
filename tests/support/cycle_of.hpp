#pragma once
/// The chain from equilibrium to cycle on a small model, as the program runs it.
#include "small_models.hpp"
#include "squeal/cycle/limit_cycle.hpp"

#include <doctest/doctest.h>

namespace squeal::test
{

inline LimitCycle cycle_of(const SmallModel& model, const CycleSettings& settings, const CycleOptions& options,
                           const State* given)
{
  const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
  REQUIRE(equilibrium.outcome.kind == OutcomeKind::converged);
  const SlidingEquilibrium sliding{model.structure, model.interface, equilibrium};
  const LinearisedSliding linearised = linearise(sliding);
  ModesSettings modes_settings;
  const Modes modes = find_modes(sliding, linearised, modes_settings, {});
  REQUIRE(!modes.modes.empty());
  const ComplexMode& mode = modes.modes.front();
  const Estimate estimate = estimate_amplitude(sliding, linearised, mode);
  const StepOptions step;
  const ModesOptions modes_options;
  const UnstableModes unstable{{&mode, 1}, {&estimate, 1}};
  std::optional<State> state = given ? copy_of(*given) : state_on_modes(sliding, unstable, settings);
  std::optional<GivenStart> start;
  if (state) start = GivenStart{std::move(*state)};
  CycleProblem problem{
      sliding, linearised, modes.modes, unstable, settings, step, modes_options, nullptr, start ? &*start : nullptr};
  return find_cycle_from_start(problem, options);
}

inline LimitCycle cycle_of(const SmallModel& model, int steps, int free, double tolerance, const CycleOptions& options)
{
  CycleSettings settings;
  settings.steps_per_period = steps;
  settings.free_periods = free;
  settings.tolerance = tolerance;
  return cycle_of(model, settings, options, nullptr);
}

inline LimitCycle cycle_of(const SmallModel& model, int steps, int free, double tolerance)
{
  return cycle_of(model, steps, free, tolerance, {});
}

} // namespace squeal::test
