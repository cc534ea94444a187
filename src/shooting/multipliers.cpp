#include "squeal/shooting/multipliers.hpp"

#include "monodromy.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/progress.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// All multipliers. Their bars are what a grid moved by half a step and one of twice as many change. Bars of real
/// multipliers hold by how much the shift in time misses 1.
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
  const std::vector<DenseEigenpair> pairs = pairs_on({0, 1, true});
  const std::vector<Complex> values = values_of(pairs), later = values_of(pairs_on({0.5, 1, true})),
                             finer = values_of(pairs_on({0, 2, true}));
  if (!finite)
  {
    multipliers.stability = Stability::undecided;
    multipliers.would_decide = "the tangent of this period is not finite: other steps a period would decide";
    return result;
  }
  monodromy.flow.record_period(orbit.period, orbit.state, {});
  const Owned<Vec> rate = copy_of(orbit.rate.get());
  const std::size_t shift = find_shift(pairs, inner_products(space.left, block_of(std::span(&rate, 1))).col(0));
  multipliers.trivial_error = std::abs(values[shift] - 1.);
  const std::vector<std::size_t> at_later = nearest_places(values, later), at_finer = nearest_places(values, finer);
  for (std::size_t i = 0; i < values.size(); ++i) // largest first
  {
    constexpr double of_order_1 = 2, rounding = 1e-9; // order 1 where contact hits or turns
    if (i == shift) continue;
    const double size = std::abs(values[i]), moved = std::abs(std::abs(later[at_later[i]]) - size),
                 refined = std::abs(std::abs(finer[at_finer[i]]) - size);
    multipliers.values.push_back(values[i]);
    multipliers.errors.push_back(
        std::max({moved + of_order_1 * refined, moved_by_grid(multipliers, values[i]), rounding}));
  }
  if (multipliers.values.empty()) return result;
  decide(multipliers, "");
  const auto combined = [&](const Eigen::VectorXd& y)
  { return std::move(states_of(combination(space.right, y), orbit.state).front()); };
  const std::size_t place = deciding_place(multipliers);
  result.fastest = fastest_motion(monodromy.flow, pairs[place < shift ? place : place + 1], combined);
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
