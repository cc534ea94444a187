#include "squeal/shooting/shooting.hpp"

#include "free_periods.hpp"
#include "newton_krylov.hpp"
#include "squeal/shooting/full_space.hpp"
#include "subspace_newton.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Adds (u, 0) and (0, v) to the base.
void append_shapes(const OrbitProblem& problem, double rank_tolerance, std::vector<Owned<Vec>>& base, Vec u, Vec v)
{
  const Owned<Vec> moved = zeros_like(problem.equilibrium), moving = zeros_like(problem.equilibrium);
  check(VecCopy(u, displacement(moved)));
  check(VecCopy(v, velocity(moving)));
  extend_base(problem.flow, rank_tolerance, base, moved);
  extend_base(problem.flow, rank_tolerance, base, moving);
}

/// Newton on the subspace of the shapes, then on subspaces grown by the defect that the last one left. A result that
/// falls onto the equilibrium is refused: the projected residual can only be small there.
Orbit shoot_on_subspaces(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log, Orbit orbit,
                         const std::vector<Vec>& shapes)
{
  const bool finish_follows = options.finish != Finish::none;
  PetscInt growths = options.base_growths;
  if (growths < 0) growths = finish_follows ? 0 : 4;
  std::vector<Owned<Vec>> base;
  for (const Vec shape : shapes) append_shapes(problem, options.rank_tolerance, base, shape, shape);
  Orbit best = copy_of(orbit);
  for (PetscInt growth = 0; growth <= growths; ++growth)
  {
    const ShootingStage stage = growth == 0 ? ShootingStage::subspace : ShootingStage::grown_subspace;
    orbit = shoot_on_subspace(problem, options, log, orbit, base, stage);
    if (collapsing(problem, orbit) || !std::isfinite(orbit.residual)) break;
    // Without a finish this is the result, whatever the start was worth.
    if (orbit.residual < best.residual || !finish_follows) best = copy_of(orbit);
    if (orbit.residual <= problem.tolerance) break;
    append_shapes(problem, options.rank_tolerance, base, displacement(orbit.defect), velocity(orbit.defect));
  }
  return best;
}

/// An orbit gone round twice is a solution, too. Where half the period nearly closes it, that solution is taken.
StageResult prefer_half_period(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                               StageResult found)
{
  Orbit half = evaluate(problem, log, found.orbit.state, found.orbit.period / 2);
  if (!(half.residual < 1e-2)) return found;
  StageResult once = shoot_in_full_space(problem, options, log, std::move(half));
  return once.ending == StageEnding::converged ? std::move(once) : std::move(found);
}

/// Another orbit from a start beside one that repels, displaced along the motion that grows, first towards less energy,
/// far enough that free periods lead elsewhere. Without one, the orbit itself.
StageResult search_beside(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                          const Orbit& orbit, Vec growing)
{
  const Owned<Vec> fluctuation = fluctuation_of(problem, orbit);
  const double outwards = energy_product(problem.flow, fluctuation, growing) > 0 ? 1 : -1;
  for (const double side : {-outwards, outwards})
  {
    if (log.convergence.periods >= options.max_periods) break;
    const Owned<Vec> start = copy_of(orbit.state);
    check(VecAXPY(start, 0.1 * side * orbit.fluctuation, growing));
    StageResult other =
        shoot_in_full_space(problem, options, log, integrate_free_periods(problem, log, start, orbit.period, 20));
    if (other.ending == StageEnding::converged) return other;
  }
  return {copy_of(orbit), StageEnding::converged};
}

/// Sets the multipliers of a converged orbit. One that repels is exchanged for another that may not, if one is found.
StageResult prefer_attracting(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                              StageResult found, const std::vector<Owned<Vec>>& other_unstable,
                              Multipliers& multipliers)
{
  FloquetAnalysis first = find_multipliers(problem, options, found.orbit, other_unstable);
  multipliers = std::move(first.multipliers);
  if (multipliers.stability != Stability::unstable || log.convergence.periods >= options.max_periods) return found;
  StageResult other = search_beside(problem, options, log, found.orbit, first.fastest);
  Multipliers second = find_multipliers(problem, options, other.orbit, other_unstable).multipliers;
  second.periods += multipliers.periods;
  if (second.stability == Stability::unstable)
  {
    multipliers.periods = second.periods;
    return found;
  }
  multipliers = std::move(second);
  return other;
}

/// How the search for an orbit ended.
Outcome outcome_of(const Convergence& convergence, const StageResult& found)
{
  Outcome outcome{OutcomeKind::not_converged, "", convergence.iterations, found.orbit.residual};
  switch (found.ending)
  {
  case StageEnding::converged:
    outcome.kind = OutcomeKind::converged;
    break;
  case StageEnding::stalled:
    outcome.reason = "full residual above the tolerance after " + std::to_string(convergence.periods) + " periods";
    break;
  case StageEnding::collapsed:
    outcome.kind = OutcomeKind::collapsed_to_equilibrium;
    outcome.reason = "the fluctuation fell below a tenth of the energy at the start and at the first event that limits "
                     "growth";
    break;
  case StageEnding::period_left_range:
    outcome.kind = OutcomeKind::not_periodic;
    outcome.reason = "the period left the range between half and twice the first one";
    break;
  }
  return outcome;
}

} // namespace

OrbitProblem problem_of(const Flow& flow, const Preconditioner& preconditioner, const ShootingStart& start,
                        double tolerance)
{
  const Owned<Vec> rest = zeros_like(start.equilibrium);
  return {flow, preconditioner, state_of(start.equilibrium, rest), start.period, tolerance, 0};
}

ShootingResult shoot(const Flow& flow, const Preconditioner& preconditioner, const ShootingStart& start,
                     const ShootingSettings& settings, const ShootingOptions& options)
{
  Progress progress(comm_of(start.u), "cycle", settings.free_periods + 60.);
  ConvergenceLog log{progress};
  OrbitProblem problem = problem_of(flow, preconditioner, start, settings.tolerance);
  const Owned<Vec> first = state_of(start.u, start.v);
  Orbit orbit = integrate_free_periods(problem, log, first, start.period, settings.free_periods);
  // Below the first event nothing limits a motion; above it a start may be ten times too large and still find one.
  problem.least_fluctuation = std::min(orbit.fluctuation, start.first_event) * std::sqrt(0.1);
  if (orbit.residual > problem.tolerance && options.subspace_newtons != 0 && !start.shapes.empty())
    orbit = shoot_on_subspaces(problem, options, log, std::move(orbit), start.shapes);
  StageResult found = shoot_in_full_space(problem, options, log, std::move(orbit));

  ShootingResult result;
  if (found.ending == StageEnding::converged) found = prefer_half_period(problem, options, log, std::move(found));
  if (found.ending == StageEnding::converged)
    found = prefer_attracting(problem, options, log, std::move(found), start.other_unstable, result.multipliers);
  result.outcome = outcome_of(log.convergence, found);
  refuse_repelling(result.multipliers, start.other_unstable.size(), result.outcome);
  result.orbit = std::move(found.orbit);
  result.convergence = std::move(log.convergence);
  return result;
}

void refuse_repelling(const Multipliers& multipliers, std::size_t other_unstable, Outcome& outcome)
{
  if (outcome.kind != OutcomeKind::converged || multipliers.stability != Stability::unstable) return;
  outcome.kind = other_unstable == 0 ? OutcomeKind::unstable_cycle : OutcomeKind::not_periodic;
  outcome.reason = format("the cycle found repels: a small motion beside it grows %.4g times a period (%s)",
                          std::abs(multipliers.values.front()), word(multipliers.crossing));
  outcome.reason += other_unstable == 0 ? "; try another start or more free periods"
                                        : "; " + std::to_string(other_unstable + 1) +
                                              " modes are unstable and the motion may be quasi-periodic: integrate it";
}

void declare_solver_options()
{
  declare_subspace_options();
  declare_newton_krylov_options();
}

} // namespace squeal
