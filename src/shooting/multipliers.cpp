#include "squeal/shooting/multipliers.hpp"

#include "arnoldi_multipliers.hpp"
#include "squeal/base/constants.hpp"
#include "whole_matrix.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// The sum of a change of amplitude and the other unstable motions, each of energy norm 1.
Owned<Vec> motions_that_may_grow(const OrbitProblem& problem, const Orbit& orbit,
                                 const std::vector<Owned<Vec>>& other_unstable)
{
  Owned<Vec> start = fluctuation_of(problem, orbit);
  normalise(problem.flow, start);
  for (const Owned<Vec>& motion : other_unstable) check(VecAXPY(start, 1 / energy_norm(problem.flow, motion), motion));
  return start;
}

/// All multipliers. Bars: the change of each when the grid of time moves by half a step.
FloquetAnalysis from_whole_matrix(const Monodromy& monodromy, PetscInt dofs)
{
  FloquetAnalysis result;
  Multipliers& multipliers = result.multipliers;
  multipliers.method = MultiplierMethod::whole;
  const Orbit& orbit = monodromy.orbit;
  std::vector<DenseEigenpair> moved;
  const auto by_multiplying = [&](std::span<const Owned<Vec>> states) { multiply(monodromy, states); };
  if (monodromy.exact())
  {
    monodromy.flow.record_period(orbit.period, orbit.state, 0.5);
    moved = solve_dense_unsymmetric(whole_matrix(orbit, by_multiplying));
    monodromy.flow.record_period(orbit.period, orbit.state, 0);
    multipliers.periods += 2 * dofs;
  }
  std::vector<DenseEigenpair> pairs = solve_dense_unsymmetric(whole_matrix(orbit, by_multiplying));
  multipliers.periods += 2 * dofs;
  const std::size_t shift = find_shift(pairs, coordinates_of(orbit.rate, orbit.period));
  multipliers.trivial_error = std::abs(pairs[shift].lambda - 1.);
  pairs.erase(pairs.begin() + static_cast<std::ptrdiff_t>(shift));
  for (const DenseEigenpair& pair : pairs)
  {
    double error = multipliers.trivial_error; // of the differences
    if (!moved.empty())
    {
      const auto nearest =
          std::min_element(moved.begin(), moved.end(),
                           [&](const DenseEigenpair& a, const DenseEigenpair& b)
                           { return std::abs(a.lambda - pair.lambda) < std::abs(b.lambda - pair.lambda); });
      error = std::abs(nearest->lambda - pair.lambda);
    }
    multipliers.values.push_back(pair.lambda);
    multipliers.errors.push_back(std::max(error, 1e-9));
  }
  if (pairs.empty()) return result;
  decide(multipliers, {true, ""}, multipliers.values.size());
  result.fastest =
      fastest_motion(monodromy.flow, pairs.front(), [&](const Eigen::VectorXd& y) { return state_at(y, orbit); });
  return result;
}

/// How the multipliers of a system of so many degrees of freedom are found.
MultiplierMethod chosen_method(const ShootingOptions& options, const Flow& flow, PetscInt dofs)
{
  if (options.multiplier_method != MultiplierMethod::automatic) return options.multiplier_method;
  const bool exact = static_cast<bool>(flow.apply_tangent);
  if (options.multipliers > 0 ? options.multipliers >= 2 * dofs : dofs <= (exact ? 100 : 25))
    return MultiplierMethod::whole;
  return MultiplierMethod::oblique;
}

} // namespace

FloquetAnalysis find_multipliers(const OrbitProblem& problem, const ShootingOptions& options, const Orbit& orbit,
                                 const std::vector<Owned<Vec>>& other_unstable)
{
  if (options.multipliers == 0) return {};
  const PetscInt dofs = dofs_of(orbit.state);
  Monodromy monodromy{problem.flow, orbit, options.difference * orbit.fluctuation};
  const MultiplierMethod method = chosen_method(options, problem.flow, dofs);
  if (method == MultiplierMethod::whole) return from_whole_matrix(monodromy, dofs);
  std::string refusal;
  if (method == MultiplierMethod::oblique && problem.flow.slow_motions)
    if (auto found = multipliers_by_projection(monodromy, options.multipliers, refusal)) return std::move(*found);
  const PetscInt steps = options.multipliers > 0 ? options.multipliers : dofs <= large_model ? -96 : -24;
  FloquetAnalysis result =
      multipliers_by_arnoldi(monodromy, motions_that_may_grow(problem, orbit, other_unstable), steps);
  result.multipliers.refusal = std::move(refusal);
  return result;
}

} // namespace squeal
