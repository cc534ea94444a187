#include "squeal/cycle/period_map.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/base/statistics.hpp"

#include <algorithm>
#include <cstdint>

namespace squeal
{

namespace
{

void set_step(PeriodMap& map, double h)
{
  map.kept.h = h;
  map.step.contact = map.options.contact;
  if (h == map.step.h) return;
  map.step = make_theta_step(map.sliding.structure, map.sliding.interface, h, map.theta, map.options);
}

/// The kept step where the line from N h to T neglects less than 3 % of what the last period moved its start
/// by; else T/N.
double step_for(const PeriodMap& map, double period)
{
  const double own = period / map.steps, missing = period - map.steps * map.kept.h;
  if (!map.keeps_step || map.kept.h == 0 || map.kept.curvature == 0) return own;
  constexpr double part = 0.03; // a period of shooting lowers the residual by more than that of itself
  return map.kept.curvature * missing * missing / 2 <= part * map.kept.moved ? map.kept.h : own;
}

/// Turns `rate`, which holds x_(N-1), into dPhi/dT. `end`, the state x_N, goes a step on.
void complete_rate(PeriodMap& map, StepWork& work, State& end, Vec rate)
{
  const double half = 0.5 / map.step.h;
  map.reactions = end.reactions;
  (void)advance(map.step, map.sliding.structure, map.sliding.interface, work, end);
  check(VecAXPBY(displacement(rate), half, -half, end.u));
  check(VecAXPBY(velocity(rate), half, -half, end.v));
}

/// Makes room for the records of a period from this start.
void begin_record(PeriodMap& map, Vec start)
{
  map.records.clear();
  map.events.clear();
  map.records.resize(static_cast<std::size_t>(map.steps));
  map.recorded_start = copy_of(start);
  map.recorded_step = map.step.h;
}

/// Whether the records are those of the period from this start.
bool is_recorded(const PeriodMap& map, Vec start)
{
  if (!map.recorded_start.get() || map.recorded_step != map.step.h ||
      map.records.size() != static_cast<std::size_t>(map.steps))
    return false;
  PetscBool same = PETSC_FALSE;
  check(VecEqual(map.recorded_start, start, &same));
  return same == PETSC_TRUE;
}

/// From N h to T along the rate; notes how far the step reaches from its `next` velocity, that at (N + 1) h.
void end_at_period(PeriodMap& map, double period, Vec start, Vec end, Vec rate, Vec next)
{
  const double h = map.step.h;
  const Owned<Vec> difference = copy_of(next);
  check(VecAXPBYPCZ(difference, -1, -h, 1, velocity(end), velocity(rate)));
  const double bend = norm_of(difference, NORM_2), speed = norm_of(velocity(end), NORM_2);
  check(VecAXPY(displacement(end), period - map.steps * h, displacement(rate)));
  check(VecAXPY(velocity(end), period - map.steps * h, velocity(rate)));
  check(VecWAXPY(difference, -1, velocity(start), velocity(end)));
  const double moved = norm_of(difference, NORM_2) / norm_of(velocity(start), NORM_2);
  map.kept = {h, 2 * bend / (h * h * speed), moved};
}

void integrate_period(PeriodMap& map, double period, Vec start, Vec end, Vec rate)
{
  const auto& [structure, interface, equilibrium] = map.sliding;
  set_step(map, rate ? step_for(map, period) : period / map.steps);
  State state{copy_of(displacement(start)), copy_of(velocity(start)), 0, map.reactions};
  if (rate) begin_record(map, start);
  const auto after = [&, done = 0](const StepReport& report, const StepWork&) mutable
  {
    if (rate && ++done + 1 == map.steps)
    {
      check(VecCopy(state.u, displacement(rate)));
      check(VecCopy(state.v, velocity(rate)));
    }
    map.unconverged += !report.contact_converged;
    end_if_asked(comm_of(structure.load));
    return true;
  };
  StepWatch watch{{}, {}, after};
  if (rate) watch.records = map.records;
  StepWork work = take_steps(map.step, structure, interface, state, map.steps, watch);
  check(VecCopy(state.u, displacement(end)));
  check(VecCopy(state.v, velocity(end)));
  if (!rate) return;
  note_joints(map, start);
  complete_rate(map, work, state, rate);
  if (map.keeps_step) end_at_period(map, period, start, end, rate, state.v);
}

} // namespace

void set_period(PeriodMap& map, double period)
{
  set_step(map, period / map.steps);
}

void move_by_part(const PeriodMap& map, double part, State& state)
{
  State next = copy_of(state);
  const Owned<Vec> v = copy_of(state.v.get());
  StepWork work = begin_steps(map.step, map.sliding.structure, map.sliding.interface, next);
  (void)advance(map.step, map.sliding.structure, map.sliding.interface, work, next);
  const double s = part, h = map.step.h, from_end = s * s * (3 - 2 * s);
  check(VecAXPBYPCZ(state.u, from_end, h * s * (1 - s) * (1 - s), 1 - from_end, next.u, v));
  check(VecAXPY(state.u, -h * s * s * (1 - s), next.v));
  check(VecAXPBY(state.v, s, 1 - s, next.v));
  state.reactions = next.reactions;
}

void note_joints(PeriodMap& map, Vec start)
{
  const Interface& interface = map.sliding.interface;
  if (!has_undriven_pairs(interface)) return;
  const std::vector<std::vector<double>> motion = relative(interface, std::array{displacement(start), velocity(start)});
  map.joints = joint_motion(interface, map.step, map.records, motion[0], motion[1]);
  map.rest.follow(map.sliding, map.options.factor, map.joints);
}

namespace
{

/// Records the steps from the state, which goes on; `after` each one.
void record_steps(PeriodMap& map, int steps, State& state, const std::function<void()>& after)
{
  map.records = std::vector<StepRecord>(static_cast<std::size_t>(steps));
  const auto watch = [&](const StepReport&, const StepWork&)
  {
    if (after) after();
    end_if_asked(comm_of(state.u));
    return true;
  };
  take_steps(map.step, map.sliding.structure, map.sliding.interface, state, steps, {map.records, {}, watch});
}

/// Records the steps and the events inside them, from the first step on that no event lies across.
void record_with_events(PeriodMap& map, int steps, State state)
{
  std::vector<TangentColumn> states;
  const auto keep = [&] { states.push_back({copy_of(state.u.get()), copy_of(state.v.get())}); };
  keep();
  record_steps(map, steps, state, keep);
  map.events = events_inside_steps(map.step, map.sliding.interface, map.records, states);
  const auto first_from = [&](const StepEvent& event, long begin) { return (event.first - begin + steps) % steps; };
  long begin = 0;
  const auto lies_across = [&](const StepEvent& event)
  {
    const long first = first_from(event, begin);
    return first < 2 || first + event.end - event.first > steps;
  };
  while (begin + 1 < steps && std::ranges::any_of(map.events, lies_across)) ++begin;
  std::ranges::rotate(map.records, map.records.begin() + begin);
  for (StepEvent& event : map.events)
  {
    const long first = first_from(event, begin);
    event.end += first - event.first;
    event.first = first;
  }
  std::ranges::stable_sort(map.events, {}, &StepEvent::first);
}

} // namespace

void record_period(PeriodMap& map, double period, Vec start, const TimeGrid& grid)
{
  const int steps = grid.steps(map.steps);
  set_step(map, period / steps);
  if (grid.shift == 0 && steps == map.steps && is_recorded(map, start)) return;
  State state{copy_of(displacement(start)), copy_of(velocity(start)), 0, map.reactions};
  if (grid.shift > 0) move_by_part(map, grid.shift, state);
  map.recorded_start = {};
  map.events.clear();
  if (grid.events) return record_with_events(map, steps, std::move(state));
  record_steps(map, steps, state, {});
  if (grid.shift > 0 || steps != map.steps) return;
  map.recorded_start = copy_of(start);
  map.recorded_step = map.step.h;
}

namespace
{

void apply_tangent(const PeriodMap& map, std::span<const Vec> states)
{
  std::vector<TangentColumn> columns;
  for (const Vec state : states) columns.push_back({copy_of(displacement(state)), copy_of(velocity(state))});
  advance_tangents(map.step, map.sliding.structure, map.sliding.interface, map.records, map.events, columns);
  for (std::size_t k = 0; k < states.size(); ++k)
  {
    check(VecCopy(columns[k].u, displacement(states[k])));
    check(VecCopy(columns[k].v, velocity(states[k])));
  }
}

} // namespace

Flow flow_of(PeriodMap& map)
{
  const auto integrate = [&map](double period, Vec start, Vec end, Vec rate)
  { integrate_period(map, period, start, end, rate); };
  Flow flow{integrate, map.sliding.structure.M, map.sliding.structure.K};
  flow.work = map.steps * work_of_step(map.sliding.structure);
  flow.record_period = [&map](double period, Vec start, const TimeGrid& grid)
  { record_period(map, period, start, grid); };
  flow.apply_tangent = [&map](std::span<const Vec> states) { apply_tangent(map, states); };
  if (!has_undriven_pairs(map.sliding.interface)) return flow;
  flow.offsets.motion = [&map] { return map.joints.slip; };
  flow.offsets.find_rest = [&map](Vec rest)
  { check(VecCopy(map.rest.about(map.sliding).equilibrium.u, displacement(rest))); };
  flow.offsets.without_held = [&map](Vec part)
  { take_out_tangents(map.sliding.interface, held_pairs(map.sliding.interface, map.records), part); };
  return flow;
}

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

MeasuredPeriod measure_period(PeriodMap& map, const Recording& recording, double period, Vec start)
{
  MeasuredPeriod measured;
  measured.start = {copy_of(displacement(start)), copy_of(velocity(start)), 0, map.reactions};
  State end = copy_of(measured.start);
  set_period(map, period);
  const std::int64_t samples = recording.samples; // done * samples may not fit an int
  int done = 0;
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
    // evenly spread over the period whatever the two numbers
    if ((done + 1) * samples / map.steps > done * samples / map.steps) measured.displacements.push_back(copy_of(now.u));
    ++done;
  };
  const MarchSummary summary = march(map.step, map.rest.about(map.sliding), map.steps, end,
                                     {recording.probes, measured.history, watch, records});
  if (summary.interrupted) throw Interrupted{};
  map.unconverged += summary.unconverged;
  measured.joints = joint_use(map.sliding.interface, records);
  note_joints(map, start);
  summarise(measured);
  return measured;
}

} // namespace squeal
