#include "squeal/branch/brake_branch.hpp"

#include "equilibrium_stability.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

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
  for (const BranchPoint& point : branch.points) outcome.residual = std::max(outcome.residual, point.residual);
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

void widen(ParameterRange& range, double parameter)
{
  range.from = std::min(range.from, parameter);
  range.to = std::max(range.to, parameter);
}

/// Where a stable cycle stands beside a stable equilibrium: ranges of successive points, up to the Hopf point between
/// stable cycles.
std::vector<ParameterRange> coexistence_of(const BrakeBranch& found, const std::vector<BranchEvent>& hopf)
{
  std::vector<ParameterRange> ranges;
  const BranchPoint* before = nullptr; // a stable cycle
  bool open = false;
  for (const BranchPoint& point : found.branch.points)
  {
    const bool stable = point.multipliers.stability == Stability::stable;
    const bool both = stable && unstable_modes_at(point.parameter, found.equilibria, hopf) == 0;
    if (both && !open) ranges.push_back({point.parameter, point.parameter});
    if (both) widen(ranges.back(), point.parameter);
    if (both != open && stable && before)
      for (const BranchEvent& event : hopf)
        if ((event.parameter - before->parameter) * (event.parameter - point.parameter) < 0)
          widen(ranges.back(), event.parameter);
    before = stable ? &point : nullptr;
    open = both;
  }
  return ranges;
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
                                          settings.points, problem.tolerance};
  BrakeFamily family(problem);
  BrakeBranch found;
  found.equilibria = equilibria_along(family, problem);
  std::vector<BranchEvent> hopf = hopf_points(family, problem, found.equilibria);
  family.set_parameter(problem.settings.own);
  found.branch =
      trace_branch(family.flows(), continuation, problem.shooting, problem.cycle.orbit, problem.settings.own);
  found.coexistence = coexistence_of(found, hopf);
  found.outcome = outcome_of(problem, found.branch);
  found.branch.events.insert(found.branch.events.begin(), hopf.begin(), hopf.end());
  return found;
}

} // namespace squeal
