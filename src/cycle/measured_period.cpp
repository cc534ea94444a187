#include "squeal/cycle/measured_period.hpp"

#include "squeal/base/mean.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <cstdint>

namespace squeal
{

namespace
{

/// Means and extremes from the history.
void summarise(MeasuredPeriod& measured)
{
  const History& history = measured.history;
  if (history.energy.empty()) return;
  measured.mean_energy = mean(history.energy);
  measured.mean_fluctuating_energy = mean(history.fluctuating_energy);
  measured.open_pairs_mean = mean(history.open);
  measured.open_pairs_max = *std::max_element(history.open.begin(), history.open.end());
  measured.stick_pairs_max = *std::max_element(history.stick.begin(), history.stick.end());
  for (const auto& probe : history.probes)
  {
    const auto [least, largest] = std::minmax_element(probe.begin(), probe.end());
    measured.peak_to_peak.push_back(*largest - *least);
  }
}

} // namespace

MeasuredPeriod measure_period(PeriodMap& map, const Recording& recording, double period, Vec start, Vec rate)
{
  MeasuredPeriod measured;
  measured.start = {copy_of(displacement(start)), copy_of(velocity(start)), 0, map.reactions};
  measured.end = copy_of(measured.start);
  const auto keep_for_rate = [&](const State& now)
  {
    check(VecCopy(now.u, displacement(rate)));
    check(VecCopy(now.v, velocity(rate)));
  };
  if (rate) keep_for_rate(measured.start);
  set_period(map, period);
  const std::int64_t samples = recording.samples; // done * samples may not fit an int
  int done = 0;
  JointUseMeter joints;
  std::span<StepRecord> records; // what joints do is known from the steps' contact
  if (has_undriven_pairs(map.sliding.interface))
  {
    map.records.clear();
    map.records.resize(static_cast<std::size_t>(map.steps));
    map.recorded_start = {};
    records = map.records;
  }
  const auto watch = [&](const State& now, const StepReport&, const StepWork&)
  {
    measured.statuses.push_back(contact_status(map.sliding.interface, now.reactions, now.v));
    if (!records.empty()) joints.add_step(map.sliding.interface, now.reactions, measured.statuses.back());
    // evenly spread over the period whatever the two numbers
    if ((done + 1) * samples / map.steps > done * samples / map.steps) measured.displacements.push_back(copy_of(now.u));
    if (++done + 1 == map.steps && rate) keep_for_rate(now);
  };
  const MarchSummary summary = march(map.step, map.rest.about(map.sliding), map.steps, measured.end,
                                     {recording.probes, measured.history, watch, records});
  if (summary.interrupted) throw Interrupted{};
  map.unconverged += summary.unconverged;
  measured.joints = joints.result();
  note_joints(map, start);
  if (rate)
  {
    State after = copy_of(measured.end);
    StepWork work = begin_steps(map.step, map.sliding.structure, map.sliding.interface, after);
    complete_rate(map, work, after, rate);
  }
  summarise(measured);
  return measured;
}

} // namespace squeal
