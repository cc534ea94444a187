#include "squeal/branch/brake_branch.hpp"

#include "squeal/base/cost.hpp"
#include "squeal/cycle/floquet.hpp"
#include "squeal/scene/numbers.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

namespace squeal
{

namespace
{

/// Adds the counts of a period, from the statuses of the pairs at its steps.
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

/// The brake at a value of the parameter.
struct BrakeAt
{
  BrakeAt(double value, Model made, const BrakeBranchProblem& branch)
      : parameter(value), model(std::move(made)),
        problem(at_equilibrium(branch.own, {model.structure, model.interface, equilibrium})),
        map{problem.sliding, branch.own.step, branch.steps_per_period, branch.cycle.theta}, flow(flow_of(map))
  {
    add_slow_motions(problem, map, steps_to_compare(model.structure, map.steps), flow);
  }

  double parameter;
  Model model;
  Equilibrium equilibrium{};
  bool equilibrium_known = false;
  CycleProblem problem; // with the modes of the scene's own value
  PeriodMap map;
  Flow flow; // of the map
};

/// The period maps of a brake at the values of a parameter, as a family of flows.
class BrakeFamily
{
public:
  explicit BrakeFamily(const BrakeBranchProblem& problem)
      : problem_(problem), friction_(problem.settings.key == friction_coefficient_key)
  {
    set_parameter(problem.settings.own);
    at_->map.reactions = problem.own.sliding.equilibrium.reactions;
    family_.set_parameter = [this](double parameter) { set_parameter(parameter); };
    family_.rest = [this] { return rest(); };
    family_.parameter_column = [this](double period, Vec start, Vec column)
    { parameter_column(period, start, column); };
    family_.measure = [this](const Orbit& orbit) { return measure(orbit); };
    if (whole_tangent_is_cheap(2. * dofs_of(problem_.cycle.orbit.state))) return;
    family_.preconditioner = [this](double period, Vec x, Vec y) { apply(inverse_, period, x, y); };
    family_.renew_preconditioner = [this]
    {
      (void)equilibrium();
      at_->problem.reduced = nullptr;
      inverse_ = [at = at_, by_record = recorded_preconditioner(at_->problem, at_->map)](double period, Vec x, Vec y)
      { by_record(period, x, y); };
    };
  }
  BrakeFamily(const BrakeFamily&) = delete;
  BrakeFamily& operator=(const BrakeFamily&) = delete;

  const FlowFamily& flows() const { return family_; }

private:
  void set_parameter(double parameter)
  {
    if (at_ && at_->parameter == parameter) return;
    if (at_ && friction_) // A and W do not depend on it
    {
      at_->parameter = parameter;
      at_->model.interface.friction.common.coefficient = parameter;
      at_->map.recorded_start = {}; // what is recorded belongs to the other friction
      at_->problem.reduced = nullptr;
      at_->equilibrium_known = false;
      return;
    }
    auto next = std::make_shared<BrakeAt>(parameter, problem_.model_at(parameter), problem_);
    if (at_) next->map.reactions = at_->map.reactions;
    at_ = std::move(next);
    Flow& flow = family_.flow = at_->flow;
    flow.M = problem_.own.sliding.structure.M;
    flow.K = problem_.own.sliding.structure.K;
    flow.slow_motions = [this](double period, Vec start)
    {
      (void)equilibrium();
      return at_->flow.slow_motions(period, start);
    };
  }

  /// The equilibrium at the value set last.
  const Equilibrium& equilibrium()
  {
    BrakeAt& at = *at_;
    if (!at.equilibrium_known)
      at.equilibrium = Equilibria(problem_.equilibrium_options).at(at.model.structure, at.model.interface);
    at.equilibrium_known = true;
    return at.equilibrium;
  }

  /// Where there is no equilibrium its displacements are zero: a reference for the fluctuation none the less.
  Owned<Vec> rest()
  {
    const Owned<Vec> at_rest = zeros_like(problem_.own.sliding.structure.load);
    return state_of(equilibrium().u, at_rest);
  }

  /// column = dPhi_period(start)/dparameter: exact by friction, else by a central difference.
  void parameter_column(double period, Vec start, Vec column)
  {
    if (!friction_) return difference_column(period, start, column);
    at_->flow.record_period(period, start, {});
    const Vec load = at_->model.structure.load;
    TangentColumn change{zeros_like(load), zeros_like(load), 1};
    PeriodMap& map = at_->map;
    advance_tangents(map.step, map.sliding.structure, map.sliding.interface, map.records, std::span(&change, 1));
    check(VecCopy(change.u, displacement(column)));
    check(VecCopy(change.v, velocity(column)));
  }

  void difference_column(double period, Vec start, Vec column)
  {
    // 1e-5 of the range: the contact's tolerance of 1e-10 is then below 1e-4 of the quotient
    const double parameter = at_->parameter, change = 1e-5 * std::abs(problem_.settings.to - problem_.settings.from);
    const Owned<Vec> below = zeros_like(column);
    set_parameter(parameter + change);
    at_->flow.integrate(period, start, column, nullptr);
    set_parameter(parameter - change);
    at_->flow.integrate(period, start, below, nullptr);
    set_parameter(parameter);
    check(VecAXPBY(column, -0.5 / change, 0.5 / change, below));
  }

  PointMeasures measure(const Orbit& orbit)
  {
    (void)equilibrium(); // energies refer to it
    MeasuredPeriod measured = measure_period(at_->map, {problem_.own.probes, 0}, orbit.period, orbit.state);
    PointMeasures measures{measured.mean_energy, measured.mean_fluctuating_energy, std::move(measured.peak_to_peak),
                           measured.open_pairs_mean};
    count_statuses(measured.statuses, measures);
    measures.slips_nonlinearly = depends_on_speed(at_->model.interface.friction);
    return measures;
  }

  const BrakeBranchProblem& problem_;
  FlowFamily family_{}; // its flow is that of the value set last
  bool friction_;       // the parameter is the friction coefficient
  std::shared_ptr<BrakeAt> at_{};
  Preconditioner inverse_{}; // of the period at which the Jacobian was formed last; holds its brake
};

/// Whether a side ended where the branch ends, and not where the method does.
bool natural(BranchEnding ending)
{
  return ending != BranchEnding::step_too_small && ending != BranchEnding::number_of_points;
}

Outcome outcome_of(const BrakeBranchProblem& problem, const Branch& branch)
{
  Outcome outcome{OutcomeKind::converged, "", static_cast<int>(branch.points.size()), 0};
  if (branch.points.empty())
  {
    outcome.kind = OutcomeKind::not_converged;
    outcome.reason = format("the cycle to start from does not close within %.0e at %d steps a period",
                            problem.tolerance, problem.steps_per_period);
    return outcome;
  }
  for (const BranchPoint& point : branch.points) outcome.residual = std::max(outcome.residual, point.orbit.residual);
  const auto beside_jumps = std::ranges::count_if(branch.points, [&](const BranchPoint& point)
                                                  { return point.orbit.residual > problem.tolerance; });
  if (beside_jumps > 0)
    outcome.reason =
        format("at %ld of %zu points the period's map jumps, where contact changes in a step: residuals up "
               "to %.1e; other steps a period move the jumps",
               static_cast<long>(beside_jumps), branch.points.size(), outcome.residual);
  const auto note = [&](BranchEnding ending, const BranchPoint& end)
  {
    if (natural(ending)) return;
    outcome.kind = OutcomeKind::not_converged;
    outcome.reason += (outcome.reason.empty() ? "" : "; ") +
                      format(ending == BranchEnding::step_too_small
                                 ? "the branch was followed to %s = %.6g: no cycle was found a step on"
                                 : "the branch was followed to %s = %.6g, where the number of points ran out",
                             problem.settings.key.c_str(), end.parameter);
  };
  note(branch.ends.backward, branch.points.front());
  note(branch.ends.forward, branch.points.back());
  return outcome;
}

} // namespace

std::string no_cycle_to_follow(const LimitCycle& cycle, double tolerance)
{
  if (!has_run(cycle.outcome) || !cycle.orbit.state.get()) return "there is no cycle to start from";
  // one that repels is a cycle as well
  if (cycle.outcome.kind != OutcomeKind::converged && !(cycle.orbit.residual <= tolerance))
    return "the cycle to start from did not converge";
  return {};
}

int steps_along_branch(const CycleSettings& settings, const LimitCycle& cycle)
{
  return settings.steps_per_period > 0 ? settings.steps_per_period : std::min(cycle.steps_per_period, 128);
}

BrakeBranch find_branch(const BrakeBranchProblem& problem)
{
  const BranchSettings& settings = problem.settings;
  const ContinuationSettings continuation{std::min(settings.from, settings.to), std::max(settings.from, settings.to),
                                          settings.points, problem.tolerance, problem.steps_per_period};
  const BrakeFamily family(problem);
  BrakeBranch found;
  found.branch =
      trace_branch(family.flows(), continuation, problem.shooting, problem.cycle.orbit, problem.settings.own);
  found.outcome = outcome_of(problem, found.branch);
  return found;
}

} // namespace squeal
