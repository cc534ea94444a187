#include "squeal/shooting/multipliers.hpp"

#include "monodromy.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/progress.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;

/// The multipliers of these places over eight periods on a grid of 8 N + 1 steps, by projection on the vectors of all.
/// Each is then taken to a period by the root nearest to its value.
std::vector<Complex> along_eight_periods(const Monodromy& monodromy, const WholeSpace& space,
                                         const std::vector<DenseEigenpair>& pairs, const std::vector<Index>& places)
{
  constexpr int periods = 8;
  const Orbit& orbit = monodromy.orbit;
  const Eigen::MatrixXd V = real_columns(pairs, space.right.columns());
  monodromy.flow.record_period(periods * orbit.period, orbit.state, {0, periods, 1});
  const Eigen::MatrixXd image =
      inner_products(space.left, image_of(monodromy, combination(space.right, V(Eigen::all, places))));
  // vectors of motions that contact takes away may be parallel: they have no part in the others' rows
  const Eigen::MatrixXd projected = V.completeOrthogonalDecomposition().solve(image)(places, Eigen::all);
  if (!projected.allFinite()) return {};

  std::vector<Complex> values, powers;
  for (const Index place : places) values.push_back(pairs[static_cast<std::size_t>(place)].lambda);
  for (const Complex value : values) powers.push_back(std::pow(value, periods));
  const std::vector<Complex> found = values_of(solve_dense_unsymmetric(projected));
  const std::vector<std::size_t> partners = nearest_places(powers, found);
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    const Complex first = std::pow(found[partners[i]], 1. / periods), value = values[i];
    for (int k = 0; k < periods; ++k)
    {
      const Complex root = first * std::polar(1., two_pi * k / periods);
      if (k == 0 || std::abs(root - value) < std::abs(values[i] - value)) values[i] = root;
    }
  }
  return values;
}

/// All multipliers. Bars: the change of each when the grid moves by half a step, and 4/3 of the change at twice the
/// steps, the error of a step of order 2. Where contact hits a mass within a step depends on the grid: a whole number
/// of steps a period places each impact at one point of its step. So the bars hold as well what changes along eight
/// periods in 8 N + 1 steps, which place it at eight points. Bars of real multipliers hold by how much that of the
/// shift in time misses 1 on either grid.
FloquetAnalysis from_whole_matrix(const Monodromy& monodromy)
{
  FloquetAnalysis result;
  Multipliers& multipliers = result.multipliers;
  multipliers.method = MultiplierMethod::whole;
  const Orbit& orbit = monodromy.orbit;
  const WholeSpace space = whole_space(monodromy.flow, orbit.period);
  bool finite = true;
  const auto pairs_on = [&](const TimeGrid& grid)
  {
    monodromy.flow.record_period(orbit.period, orbit.state, grid);
    multipliers.periods += space.right.columns();
    const Eigen::MatrixXd whole = inner_products(space.left, image_of(monodromy, space.right));
    finite = finite && whole.allFinite();
    return finite ? solve_dense_unsymmetric(whole) : std::vector<DenseEigenpair>();
  };
  std::vector<DenseEigenpair> pairs = pairs_on({});
  std::vector<std::vector<DenseEigenpair>> on_others; // the other grids
  for (const OtherGrid& other : other_grids) on_others.push_back(pairs_on(other.grid));
  monodromy.flow.record_period(orbit.period, orbit.state, {});
  const auto of_tangent_that_is_not_finite = [&]
  {
    multipliers.stability = Stability::undecided;
    multipliers.would_decide = "the tangent of this period is not finite: other steps a period would decide";
    return std::move(result);
  };
  if (!finite) return of_tangent_that_is_not_finite();
  const std::vector<Complex> values = values_of(pairs);
  GridErrors grid(values.size());
  for (std::size_t k = 0; k < on_others.size(); ++k)
    add_changes(values, values_of(on_others[k]), other_grids[k].part, grid);
  const Owned<Vec> rate = copy_of(orbit.rate.get());
  const std::size_t shift = find_shift(pairs, inner_products(space.left, block_of(std::span(&rate, 1))).col(0));
  multipliers.trivial_error = std::abs(values[shift] - 1.);
  // over eight periods the orbit's own error must not lead away from it
  const bool stays = std::pow(std::max(1., std::abs(values.front())), 8) * orbit.residual < 1e-2;
  if (stays)
  {
    constexpr double decays = 0.7; // a period: such a motion decides nothing
    std::vector<Index> places;
    for (std::size_t i = 0; i < values.size(); ++i)
      if (std::abs(values[i]) > decays || i == shift) places.push_back(static_cast<Index>(i));
    const std::vector<Complex> others = along_eight_periods(monodromy, space, pairs, places);
    multipliers.periods += static_cast<long>(8 * places.size());
    monodromy.flow.record_period(orbit.period, orbit.state, {});
    if (others.empty()) return of_tangent_that_is_not_finite();
    for (std::size_t k = 0; k < others.size(); ++k)
    {
      const auto i = static_cast<std::size_t>(places[k]);
      constexpr double with_its_own = 1.5; // error: an eighth of this grid's, or by chance some more
      grid.errors[i] = std::max(grid.errors[i], with_its_own * std::abs(others[k] - values[i]));
      grid.rises[i] = std::max(grid.rises[i], with_its_own * (std::abs(others[k]) - std::abs(values[i])));
      if (i == shift) multipliers.trivial_error = std::max(multipliers.trivial_error, std::abs(others[k] - 1.));
    }
  }
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    if (i == shift) continue;
    constexpr double rounding = 1e-9;
    const double least = std::max(rounding, stays ? moved_by_grid(multipliers, values[i]) : multipliers.trivial_error);
    multipliers.values.push_back(values[i]);
    multipliers.errors.push_back(std::max(grid.errors[i], least));
    multipliers.upper.push_back(std::abs(values[i]) + std::max(grid.rises[i], least));
  }
  pairs.erase(pairs.begin() + static_cast<std::ptrdiff_t>(shift));
  if (pairs.empty()) return result;
  decide(multipliers, {true, ""});
  const auto combined = [&](const Eigen::VectorXd& y)
  { return std::move(states_of(combination(space.right, y), orbit.state).front()); };
  result.fastest = fastest_motion(monodromy.flow, pairs[deciding_place(multipliers)], combined);
  return result;
}

/// The cheapest way by the columns that it takes.
MultiplierMethod chosen_method(const ShootingOptions& options, PetscInt dofs)
{
  if (options.multiplier_method != MultiplierMethod::automatic) return options.multiplier_method;
  return 2. * dofs <= (options.multipliers > 0 ? options.multipliers : columns_of_projection)
             ? MultiplierMethod::whole
             : MultiplierMethod::oblique;
}

/// Whether the whole matrix of a system that is not small is affordable. It takes columns on three grids of time, and
/// as many eigenproblems; their operations count a quarter of an entry read.
bool whole_is_affordable(const Flow& flow, PetscInt dofs)
{
  constexpr double grids = 3, operations = 10; // of a dense eigenproblem, over the cube of its size
  const double columns = 2. * dofs;
  const double products = columns * flow.work / columns_per_period,
               eigenproblem = operations / 4 * std::pow(columns, 3);
  return grids * (products + eigenproblem) <= affordable_work;
}

} // namespace

std::size_t deciding_place(const Multipliers& multipliers)
{
  std::size_t place = 0;
  for (std::size_t i = 1; i < multipliers.values.size(); ++i)
    if (multipliers.upper_bound(place) < multipliers.upper_bound(i)) place = i;
  return place;
}

double largest_upper_bound(const Multipliers& multipliers)
{
  if (multipliers.values.empty()) return std::numeric_limits<double>::quiet_NaN();
  return multipliers.upper_bound(deciding_place(multipliers));
}

bool largest_reaches_across(const Multipliers& multipliers)
{
  if (multipliers.values.empty()) return false;
  const std::size_t place = deciding_place(multipliers);
  return std::abs(std::abs(multipliers.values[place]) - 1) <= multipliers.errors[place];
}

FloquetAnalysis find_multipliers(const OrbitProblem& problem, const ShootingOptions& options, const Orbit& orbit)
{
  if (options.multipliers == 0) return {};
  const PetscInt dofs = dofs_of(orbit.state);
  Monodromy monodromy{problem.flow, orbit};
  std::optional<Progress> progress;
  constexpr double expected_columns = 100;
  if (is_dear(problem.flow.work))
  {
    progress.emplace(comm_of(orbit.state), "multipliers", expected_columns);
    monodromy.after_product = [&, done = 0.](std::size_t more) mutable
    {
      done += static_cast<double>(more);
      progress->update(done, format("%.0f products with the period's tangent", done));
    };
  }
  if (chosen_method(options, dofs) == MultiplierMethod::whole) return from_whole_matrix(monodromy);
  FloquetAnalysis result = multipliers_by_projection(monodromy, options.multipliers);
  if (options.multiplier_method != MultiplierMethod::automatic || !whole_is_affordable(problem.flow, dofs) ||
      result.multipliers.stability != Stability::undecided)
    return result;
  const Multipliers projected = std::move(result.multipliers);
  result = from_whole_matrix(monodromy);
  result.multipliers.periods += projected.periods;
  result.multipliers.refusal = projected.would_decide;
  return result;
}

} // namespace squeal
