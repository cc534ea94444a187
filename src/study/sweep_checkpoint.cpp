#include "sweep_checkpoint.hpp"

namespace squeal
{

void describe(Checkpoint& checkpoint, SweptMode& mode)
{
  describe_all(checkpoint, mode.lambda, mode.backward_error, mode.track, mode.mac, mode.subspace);
}

void describe(Checkpoint& checkpoint, SweepPoint& point)
{
  describe_all(checkpoint, point.values, point.reversed, point.inserted, point.outcome, point.closed, point.unstable,
               point.modes, point.beyond);
}

void describe(Checkpoint& checkpoint, Threshold& threshold)
{
  describe_all(checkpoint, threshold.values, threshold.reversed, threshold.track, threshold.error,
               threshold.frequency_hz, threshold.change);
}

void describe(Checkpoint& checkpoint, Sweep& sweep)
{
  describe_all(checkpoint, sweep.points, sweep.thresholds, sweep.tracks, sweep.lost, sweep.least_mac,
               sweep.outcome.residual, sweep.basis, sweep.passes, sweep.groups, sweep.least_mac_across,
               sweep.cut_short);
  if (checkpoint.reads()) sweep.outcome.kind = OutcomeKind::converged;
}

void describe(Checkpoint& checkpoint, SweptMotion& motion)
{
  describe_all(checkpoint, motion.outcome, motion.heard, motion.kind, motion.frequency_hz, motion.energy.value,
               motion.energy.error, motion.stability, motion.multiplier, motion.multiplier_error, motion.estimate,
               motion.residual, motion.peak_to_peak, motion.steps_per_period, motion.periods);
}

} // namespace squeal
