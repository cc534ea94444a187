#include "brake_family.hpp"

#include "squeal/scene/numbers.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

void count_statuses(const std::vector<std::vector<ContactStatus>>& statuses, PointMeasures& measures)
{
  const std::size_t steps = statuses.size(), pairs = steps > 0 ? statuses.front().size() : 0;
  for (std::size_t pair = 0; pair < pairs; ++pair)
  {
    int open = 0, lift_offs = 0;
    for (std::size_t step = 0; step < steps; ++step)
    {
      const ContactStatus now = statuses[step][pair], before = statuses[step > 0 ? step - 1 : steps - 1][pair];
      measures.stick_steps += now == ContactStatus::stick;
      open += now == ContactStatus::open;
      lift_offs += now == ContactStatus::open && before != ContactStatus::open;
    }
    if (lift_offs == 0) continue; // open or closed throughout
    measures.open_steps += open;
    measures.lift_offs += lift_offs;
  }
}

void difference_column(const FlowFamily& family, double parameter, double range, double period, Vec start, Vec column)
{
  // 1e-5 of the range: the contact's tolerance of 1e-10 is then below 1e-4 of the quotient
  const double change = 1e-5 * range;
  const Owned<Vec> below = zeros_like(column);
  family.set_parameter(parameter + change);
  family.flow.integrate(period, start, column, nullptr);
  family.set_parameter(parameter - change);
  family.flow.integrate(period, start, below, nullptr);
  family.set_parameter(parameter);
  check(VecAXPBY(column, -0.5 / change, 0.5 / change, below));
}

BrakeAt::BrakeAt(double value, BrakeModel made, const BrakeBranchProblem& problem)
    : parameter(value), model(std::move(made)), map{{model.structure, model.interface, equilibrium},
                                                    problem.step,
                                                    problem.steps_per_period,
                                                    problem.cycle.theta},
      flow(flow_of(map))
{
}

BrakeFamily::BrakeFamily(const BrakeBranchProblem& problem)
    : problem_(problem), friction_(problem.settings.key == friction_coefficient_key),
      range_(std::abs(problem.settings.to - problem.settings.from))
{
  set_parameter(problem.settings.own);
  at_->map.reactions = problem.sliding.equilibrium.reactions;
}

void BrakeFamily::set_parameter(double parameter)
{
  if (at_ && at_->parameter == parameter) return;
  if (at_ && friction_) // A and W do not depend on it
  {
    at_->parameter = parameter;
    at_->model.interface.friction.common.coefficient = parameter;
    at_->map.recorded_start = {}; // what is recorded belongs to the other friction
    at_->equilibrium_known = false;
    return;
  }
  auto next = std::make_unique<BrakeAt>(parameter, problem_.model_at(parameter), problem_);
  if (at_) next->map.reactions = at_->map.reactions;
  at_ = std::move(next);
}

SlidingEquilibrium BrakeFamily::sliding()
{
  BrakeAt& at = *at_;
  if (!at.equilibrium_known)
    at.equilibrium = Equilibria(problem_.equilibrium_options).at(at.model.structure, at.model.interface);
  at.equilibrium_known = true;
  return at.map.sliding;
}

Owned<Vec> BrakeFamily::rest()
{
  // where there is no equilibrium its displacements are zero: a reference for the fluctuation none the less
  const Owned<Vec> at_rest = zeros_like(sliding().structure.load);
  return state_of(at_->equilibrium.u, at_rest);
}

void BrakeFamily::parameter_column(double period, Vec start, Vec column)
{
  if (!friction_)
  {
    difference_column(flows(), at_->parameter, range_, period, start, column);
    return;
  }
  at_->flow.record_period(period, start, {});
  const Vec load = at_->model.structure.load;
  TangentColumn change{zeros_like(load), zeros_like(load), 0, 1};
  PeriodMap& map = at_->map;
  advance_tangents(map.step, map.sliding.structure, map.sliding.interface, map.records, std::span(&change, 1));
  check(VecCopy(change.u, displacement(column)));
  check(VecCopy(change.v, velocity(column)));
}

void BrakeFamily::start_from_rest()
{
  (void)sliding();
  at_->map.reactions = at_->equilibrium.reactions;
}

MeasuredPeriod BrakeFamily::measured_period(double period, Vec start)
{
  (void)sliding(); // energies refer to it
  return measure_period(at_->map, {problem_.probes, 0}, period, start, nullptr);
}

PointMeasures BrakeFamily::measure(const Orbit& orbit)
{
  MeasuredPeriod measured = measured_period(orbit.period, orbit.state);
  PointMeasures measures{measured.mean_energy, measured.mean_fluctuating_energy, std::move(measured.peak_to_peak),
                         measured.open_pairs_mean};
  count_statuses(measured.statuses, measures);
  measures.slips_nonlinearly = depends_on_speed(at_->model.interface.friction);
  return measures;
}

FlowFamily BrakeFamily::flows()
{
  FlowFamily family;
  family.flow.M = problem_.sliding.structure.M;
  family.flow.K = problem_.sliding.structure.K;
  family.flow.work = at_->flow.work;
  family.flow.integrate = [this](double period, Vec start, Vec end, Vec rate)
  { at_->flow.integrate(period, start, end, rate); };
  family.flow.record_period = [this](double period, Vec start, const TimeGrid& grid)
  { at_->flow.record_period(period, start, grid); };
  family.flow.apply_tangent = [this](std::span<const Vec> states) { at_->flow.apply_tangent(states); };
  if (at_->flow.offsets.motion)
  {
    family.flow.offsets.motion = [this] { return at_->flow.offsets.motion(); };
    family.flow.offsets.find_rest = [this](Vec rest) { at_->flow.offsets.find_rest(rest); };
    family.flow.offsets.without_held = [this](Vec part) { at_->flow.offsets.without_held(part); };
  }
  family.set_parameter = [this](double parameter) { set_parameter(parameter); };
  family.rest = [this] { return rest(); };
  family.parameter_column = [this](double period, Vec start, Vec column) { parameter_column(period, start, column); };
  family.measure = [this](const Orbit& orbit) { return measure(orbit); };
  return family;
}

} // namespace squeal
