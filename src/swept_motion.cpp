#include "squeal/swept_motion.hpp"

#include "squeal/find_motion.hpp"
#include "squeal/report/report.hpp"

#include <cmath>

namespace squeal
{

namespace
{

/// The scene at a point, up to what is heard.
Scene scene_at(const Scene& scene, const std::vector<double>& values)
{
  Scene at = scene_with(scene, numbers_of(scene.sweep->key, values));
  at.cycle.enabled = true;
  at.cycle.starts = 0;
  at.cycle.save_state.clear();
  at.transient.enabled = at.transient.enabled && at.cycle.start.kind == CycleStartKind::transient;
  at.transient.save_state.clear();
  at.branch.reset();
  return at;
}

/// The parts of a found cycle that are kept.
void take_cycle(const LimitCycle& cycle, SweptMotion& motion)
{
  motion.frequency_hz = 1 / cycle.orbit.period;
  motion.energy = {cycle.measured.mean_fluctuating_energy, SweptMotion::none};
  motion.peak_to_peak = cycle.measured.peak_to_peak;
  motion.stability = cycle.multipliers.stability;
  motion.residual = cycle.orbit.residual;
  if (motion.stability == Stability::stable) motion.kind = MotionKind::periodic;
  if (cycle.multipliers.values.empty()) return;
  motion.multiplier = std::abs(cycle.multipliers.values.front());
  motion.multiplier_error = cycle.multipliers.errors.front();
}

void take_settled(const SettledMotion& settled, SweptMotion& motion)
{
  motion.kind = settled.examined.verdict.kind;
  motion.frequency_hz = settled.examined.base.first;
  motion.energy = settled.fluctuating_energy;
  motion.energy.error += settled.step_error;
  motion.peak_to_peak.clear();
  for (const MeanValue& swing : settled.peak_to_peak) motion.peak_to_peak.push_back(swing.value);
}

SweptMotion motion_of(const Report& report, const Scene& scene)
{
  const auto& [cycle, fidelity, settled, followed, attempts] = report.motion;
  const Outcome& equilibrium = report.point.equilibrium.outcome;
  SweptMotion motion;
  motion.heard = heard(report, scene);
  motion.outcome = equilibrium.kind == OutcomeKind::converged ? cycle.outcome : equilibrium;
  motion.steps_per_period = cycle.steps_per_period;
  motion.periods = cycle.convergence.periods + static_cast<long>(settled.examined.periods());
  if (const Estimate& estimate = followed_estimate(report); estimate.outcome.kind == OutcomeKind::balance)
    motion.estimate = estimate.amplitude;
  const bool found = cycle.outcome.kind == OutcomeKind::converged || !cycle.multipliers.values.empty();
  if (has_run(cycle.outcome) && found) take_cycle(cycle, motion);
  if (has_run(settled.outcome)) take_settled(settled, motion);
  return motion;
}

} // namespace

SweptMotion find_swept_motion(NearbyModels& models, const Scene& scene, const ProgramOptions& options,
                              const SweptPlace& place)
{
  const Scene at = scene_at(scene, place.values);
  Model there = models.whole_at(numbers_of(scene.sweep->key, place.values));
  if (place.reversed) reverse_rotation(there.structure, there.interface);
  const StageRunner run = within_a_stage;
  Report report;
  const SlidingPoint& point = report.point = find_point(there, at, options, run);
  report.transient = run_stage(run, Stage::transient, why_off(Stage::transient, point, at),
                               [&] { return find_transient(point, at, options); });
  report.motion = find_motion(point, motion_start(point, at, report.transient), at, options, run);
  return motion_of(report, at);
}

} // namespace squeal
