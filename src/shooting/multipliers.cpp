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

using Complex = std::complex<double>;

/// The sum of a change of amplitude and the other unstable motions, each of energy norm 1.
Owned<Vec> motions_that_may_grow(const OrbitProblem& problem, const Orbit& orbit,
                                 const std::vector<Owned<Vec>>& other_unstable)
{
  Owned<Vec> start = fluctuation_of(problem, orbit);
  normalise(problem.flow, start);
  for (const Owned<Vec>& motion : other_unstable) check(VecAXPY(start, 1 / energy_norm(problem.flow, motion), motion));
  return start;
}

/// What the grid of time changes: of each of the values the distance to its partner, and the rise of its modulus.
struct GridErrors
{
  std::vector<double> errors, rises;
};

/// Adds the parts of the changes that are taken for errors.
void add_changes(const std::vector<Complex>& values, const std::vector<Complex>& others, double part,
                 GridErrors& errors)
{
  const std::vector<std::size_t> places = nearest_places(values, others);
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    const Complex other = others[places[i]];
    errors.errors[i] += part * std::abs(other - values[i]);
    errors.rises[i] += part * std::max(0., std::abs(other) - std::abs(values[i]));
  }
}

/// All multipliers. Bars: the change of each when the grid of time moves by half a step, and 4/3 of the change on one
/// of twice as many steps, which is the error of a step of order 2.
FloquetAnalysis from_whole_matrix(const Monodromy& monodromy, PetscInt dofs)
{
  FloquetAnalysis result;
  Multipliers& multipliers = result.multipliers;
  multipliers.method = MultiplierMethod::whole;
  const Orbit& orbit = monodromy.orbit;
  const Eigen::MatrixXd Q = coordinates_with_mass(monodromy.flow);
  bool finite = true;
  const auto find_pairs = [&]
  {
    multipliers.periods += 2 * dofs;
    const Eigen::MatrixXd whole =
        whole_matrix(orbit, [&](std::span<const Owned<Vec>> states) { multiply(monodromy, states); });
    finite = finite && whole.allFinite();
    return finite ? solve_dense_unsymmetric(Q.transpose() * whole * Q) : std::vector<DenseEigenpair>();
  };
  const auto pairs_on = [&](const TimeGrid& grid)
  {
    monodromy.flow.record_period(orbit.period, orbit.state, grid);
    return find_pairs();
  };
  std::vector<DenseEigenpair> pairs = monodromy.exact() ? pairs_on({}) : find_pairs(), moved, finer;
  if (monodromy.exact())
  {
    moved = pairs_on({0.5, 1});
    finer = pairs_on({0, 2});
    monodromy.flow.record_period(orbit.period, orbit.state, {});
  }
  if (!finite)
  {
    multipliers.stability = Stability::undecided;
    multipliers.would_decide = "the tangent of this period is not finite: other steps a period would decide";
    return result;
  }
  const std::vector<Complex> values = values_of(pairs);
  GridErrors grid{std::vector<double>(values.size(), 0.), std::vector<double>(values.size(), 0.)};
  if (monodromy.exact())
  {
    add_changes(values, values_of(moved), 1, grid);
    add_changes(values, values_of(finer), 4. / 3, grid);
  }
  const std::size_t shift = find_shift(pairs, Q.transpose() * coordinates_of(orbit.rate, orbit.period));
  multipliers.trivial_error = std::abs(values[shift] - 1.);
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    if (i == shift) continue;
    constexpr double rounding = 1e-9;
    const double of_differences = monodromy.exact() ? rounding : multipliers.trivial_error;
    multipliers.values.push_back(values[i]);
    multipliers.errors.push_back(std::max(grid.errors[i], of_differences));
    multipliers.upper.push_back(std::abs(values[i]) + std::max(grid.rises[i], of_differences));
  }
  pairs.erase(pairs.begin() + static_cast<std::ptrdiff_t>(shift));
  if (pairs.empty()) return result;
  decide(multipliers, {true, ""}, multipliers.values.size());
  result.fastest =
      fastest_motion(monodromy.flow, pairs.front(), [&](const Eigen::VectorXd& y) { return state_at(Q * y, orbit); });
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

double largest_upper_bound(const Multipliers& multipliers)
{
  double largest = multipliers.values.empty() ? std::numeric_limits<double>::quiet_NaN() : 0;
  for (std::size_t i = 0; i < multipliers.values.size(); ++i) largest = std::max(largest, multipliers.upper_bound(i));
  return largest;
}

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
