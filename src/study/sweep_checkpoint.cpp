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
               point.modes);
}

void describe(Checkpoint& checkpoint, Threshold& threshold)
{
  describe_all(checkpoint, threshold.values, threshold.reversed, threshold.track, threshold.error,
               threshold.frequency_hz, threshold.change);
}

void describe(Checkpoint& checkpoint, Sweep& sweep)
{
  describe_all(checkpoint, sweep.outcome, sweep.points, sweep.thresholds, sweep.tracks, sweep.lost, sweep.least_mac,
               sweep.least_mac_across, sweep.basis, sweep.passes, sweep.cut_short);
}

} // namespace squeal
