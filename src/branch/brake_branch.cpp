#include "squeal/branch/brake_branch.hpp"

#include "reduced_family.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/run_control.hpp"

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

Outcome outcome_of(const BrakeBranchProblem& problem, const BrakeBranch& found)
{
  const Branch& branch = found.branch;
  Outcome outcome{OutcomeKind::converged, "", static_cast<int>(branch.points.size()), 0};
  if (branch.points.empty())
  {
    outcome.kind = OutcomeKind::not_converged;
    outcome.reason = format("the cycle to start from does not close within %.0e at %d steps a period%s",
                            problem.tolerance, problem.steps_per_period,
                            found.reduction ? " on the reduced model: fidelity = \"full\" does without" : "");
    return outcome;
  }
  for (const BranchPoint& point : branch.points) outcome.residual = std::max(outcome.residual, point.residual);
  const auto beside_jumps = std::ranges::count_if(branch.points, [&](const BranchPoint& point)
                                                  { return point.residual > problem.tolerance; });
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
  if (found.reduction && found.reduction->missed_pairs > 0)
  {
    outcome.kind = OutcomeKind::not_converged;
    outcome.reason += (outcome.reason.empty() ? "" : "; ") +
                      format("%d pairs of the full model do what the reduced one leaves out: fidelity = \"full\"",
                             found.reduction->missed_pairs);
  }
  return outcome;
}

/// Whether so many shapes are worth a model of their own. A step of a dense model reads a few of its square matrices,
/// and one of the full model its factor, which has a few dozen entries a column: at an eighth of the size both take as
/// long, and the derivatives of the dense one still cost far less.
bool is_far_smaller(const BrakeBranchProblem& problem, std::size_t shapes)
{
  constexpr std::size_t times = 8;
  PetscInt dofs = 0;
  check(VecGetSize(problem.sliding.structure.load, &dofs));
  return times * shapes <= static_cast<std::size_t>(dofs);
}

/// A point of rank 0's branch.
struct ReducedPoint
{
  double parameter = 0, period = 0;
  Eigen::VectorXd state; // (q, v)
};

/// Those of rank 0 on every rank. Collective.
std::vector<ReducedPoint> points_of_first_rank(const Branch& branch, MPI_Comm comm)
{
  int count = static_cast<int>(branch.points.size());
  MPI_Bcast(&count, 1, MPI_INT, 0, comm);
  std::vector<ReducedPoint> points(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < points.size(); ++i)
  {
    Eigen::VectorXd all(2);
    if (i < branch.points.size())
    {
      const BranchPoint& point = branch.points[i];
      const Eigen::VectorXd state = own_coordinates().of(point.state);
      all.resize(state.size() + 2);
      all << point.parameter, point.period, state;
    }
    broadcast(all, comm);
    points[i] = {all[0], all[1], all.tail(all.size() - 2)};
  }
  return points;
}

/// One period of the full model from every point: its residual, and what its pairs do.
void check_on_full_model(BrakeFamily& full, const ReducedFamily& reduced, Branch& branch, PairsSeen& seen)
{
  const Flow flow = full.flows().flow;
  const MPI_Comm comm = comm_of(full.sliding().structure.load);
  const std::vector<ReducedPoint> points = points_of_first_rank(branch, comm);
  Progress progress(comm, "branch, full model", static_cast<double>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i)
  {
    full.set_parameter(points[i].parameter);
    const Owned<Vec> start = reduced.lifted(points[i].state), moved = full.rest();
    full.start_from_rest();
    const MeasuredPeriod measured = full.measured_period(points[i].period, start);
    const Owned<Vec> defect = state_of(measured.end.u, measured.end.v);
    check(VecAXPY(defect, -1, start));
    check(VecAYPX(moved, -1, start));
    const double residual = energy_norm(flow, defect) / energy_norm(flow, moved);
    if (i < branch.points.size()) branch.points[i].full_residual = residual;
    for (const std::vector<ContactStatus>& statuses : measured.statuses)
      for (std::size_t pair = 0; pair < statuses.size(); ++pair) seen.add(pair, statuses[pair]);
    progress.update(static_cast<double>(i + 1), format("residual %.1e", residual));
  }
}

/// The branch of a reduced model, which every rank follows by itself. Collective.
Branch trace_by_itself(ReducedFamily& reduced, const BrakeBranchProblem& problem,
                       const ContinuationSettings& continuation)
{
  const MPI_Comm comm = comm_of(problem.sliding.structure.load);
  const Orbit start = reduced.reduced(problem.cycle.orbit);
  Branch branch;
  int asked = 0;
  try
  {
    branch = trace_branch(reduced.flows(), continuation, problem.shooting, start, problem.settings.own);
  }
  catch (const Interrupted&)
  {
    asked = 1;
  }
  MPI_Allreduce(MPI_IN_PLACE, &asked, 1, MPI_INT, MPI_MAX, comm);
  do join_parts(comm); // throws where rank 0 knows as well
  while (asked != 0);  // its clock may be a little behind
  return branch;
}

/// Follows the branch on a reduced model, again while the full one's pairs do what it leaves out.
void trace_on_reduced_model(BrakeFamily& full, const BrakeBranchProblem& problem,
                            const ContinuationSettings& continuation, BrakeBranch& found)
{
  constexpr double margin = 2; // a branch reaches further than the cycle that it starts from
  constexpr int rounds = 4;
  const MPI_Comm comm = comm_of(problem.sliding.structure.load);
  PairsSeen seen = pairs_seen_in(problem, margin);
  for (int round = 1;; ++round)
  {
    ReducedFamily reduced(full, problem, seen);
    end_if_asked(comm);
    found.branch = trace_by_itself(reduced, problem, continuation);
    check_on_full_model(full, reduced, found.branch, seen);
    const auto active = seen.roles({}).active.size(), had = reduced.model().active.size();
    found.reduction = {reduced.model().size(), static_cast<int>(had), static_cast<int>(active - had),
                       reduced.interpolation_error()};
    if (active <= had || round == rounds) return;
  }
}

/// Whether a reduced model can stand for the full one: some pairs open or stick, and friction does not change with
/// speed, which those that slide throughout would have to a first order only.
bool may_reduce(const BrakeBranchProblem& problem)
{
  const PairsSeen seen = pairs_seen_in(problem, 1);
  const std::size_t active = seen.roles({}).active.size();
  const PairRows<std::size_t> rows(problem.sliding.interface.directions);
  return active > 0 && !depends_on_speed(problem.sliding.interface.friction) &&
         is_far_smaller(problem, 2 * problem.own_modes.size() + rows.rows_of(active));
}

/// Whether the branch was followed on a reduced model. "auto" goes without one where the range has no equilibria or
/// modes to make it of, or where its cycle does not close. Where it is asked for, the outcome says why there is none.
bool try_reduced_model(BrakeFamily& full, const BrakeBranchProblem& problem, const ContinuationSettings& continuation,
                       BrakeBranch& found)
{
  const bool asked = problem.fidelity == CycleModel::reduced;
  if (!asked && (problem.fidelity == CycleModel::full || !may_reduce(problem))) return false;
  try
  {
    trace_on_reduced_model(full, problem, continuation, found);
    int followed = found.branch.points.empty() ? 0 : 1;
    MPI_Bcast(&followed, 1, MPI_INT, 0, comm_of(problem.sliding.structure.load));
    if (asked || followed != 0) return true;
    found.not_reduced = "no cycle of the reduced model closes beside the full model's";
  }
  catch (const Error& error) // on every rank alike: all of them make the same samples
  {
    if (asked)
    {
      found.outcome = {OutcomeKind::refused, error.what(), 0, 0};
      return true;
    }
    found.not_reduced = error.what();
  }
  found.reduction.reset();
  full.set_parameter(problem.settings.own);
  return false;
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
  BrakeFamily family(problem);
  BrakeBranch found;
  found.equilibria = problem.stability.equilibria;
  if (!try_reduced_model(family, problem, continuation, found))
    found.branch =
        trace_branch(family.flows(), continuation, problem.shooting, problem.cycle.orbit, problem.settings.own);
  if (found.outcome.kind == OutcomeKind::refused) return found;
  found.outcome = outcome_of(problem, found);
  const std::vector<BranchEvent>& hopf = problem.stability.hopf;
  found.branch.events.insert(found.branch.events.begin(), hopf.begin(), hopf.end());
  return found;
}

} // namespace squeal
