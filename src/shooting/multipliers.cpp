#include "squeal/shooting/multipliers.hpp"

#include "monodromy.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/progress.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

namespace squeal
{

namespace
{

constexpr double decays = 0.7; // a period: such a motion decides nothing

/// The multipliers, with those of slow motions and of the shift in time along eight periods on a grid of 8 N + 1 steps,
/// by projection on the vectors of all of them: what each is a period is the root that is nearest to the value. Empty:
/// they are not finite. Adds its columns.
std::vector<Complex> along_eight_periods(const Monodromy& monodromy, const WholeSpace& space,
                                         const std::vector<DenseEigenpair>& pairs, std::size_t shift, long& columns)
{
  constexpr int periods = 8;
  const Orbit& orbit = monodromy.orbit;
  std::vector<Complex> values = values_of(pairs), powers;
  std::vector<Index> places;
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    if (!(std::abs(values[i]) > decays) && i != shift) continue;
    places.push_back(static_cast<Index>(i));
    powers.push_back(std::pow(values[i], periods));
  }
  columns += periods * static_cast<long>(places.size());
  const Eigen::MatrixXd V = real_columns(pairs, space.right.columns());
  monodromy.flow.record_period(periods * orbit.period, orbit.state, {0, periods, 1, true});
  const Eigen::MatrixXd image =
      inner_products(space.left, image_of(monodromy, combination(space.right, V(Eigen::all, places))));
  // vectors of motions that contact takes away may be parallel: they have no part in the others' rows
  const Eigen::MatrixXd projected = V.completeOrthogonalDecomposition().solve(image)(places, Eigen::all);
  if (!projected.allFinite()) return {};

  const std::vector<Complex> found = values_of(solve_dense_unsymmetric(projected));
  const std::vector<std::size_t> partners = nearest_places(powers, found);
  for (std::size_t i = 0; i < places.size(); ++i)
  {
    Complex& value = values[static_cast<std::size_t>(places[i])];
    const Complex first = std::pow(found[partners[i]], 1. / periods), own = value;
    value = first;
    for (int k = 1; k < periods; ++k)
    {
      const Complex root = first * std::polar(1., two_pi * k / periods);
      if (std::abs(root - own) < std::abs(value - own)) value = root;
    }
  }
  return values;
}

/// The bar of a modulus, from what one point of each step differs by from the mean of eight, and what a grid moved by
/// half a step and one of twice as many change it by.
double bar_of_modulus(double from_mean, double later, double finer, bool is_mean)
{
  constexpr double of_order_2 = 4. / 3; // of what twice as many steps change
  if (!is_mean) return std::abs(later) + of_order_2 * std::abs(finer);
  return std::max({std::abs(from_mean) / 2, std::abs(from_mean + later) / 2, // an eighth, or by chance some more
                   2 * std::abs(from_mean + finer)});                        // the orbit has an error of order 2, too
}

/// All multipliers. An event of contact comes at some point of its step, and moves a multiplier by what that allows: a
/// grid with a whole number of steps a period places each event at one point, eight periods in 8 N + 1 steps at eight.
/// So those of slow motions are the mean of these. Bars of real multipliers hold by how much that of the shift in time
/// misses 1.
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
  const std::vector<DenseEigenpair> pairs = pairs_on({0, 1, 0, true});
  const std::vector<Complex> own = values_of(pairs), later = values_of(pairs_on({0.5, 1, 0, true})),
                             finer = values_of(pairs_on({0, 2, 0, true}));
  const Owned<Vec> rate = copy_of(orbit.rate.get());
  const std::size_t shift = find_shift(pairs, inner_products(space.left, block_of(std::span(&rate, 1))).col(0));
  // over eight periods the orbit's own error must not lead away from it
  const bool stays = finite && std::pow(std::max(1., std::abs(own.front())), 8) * orbit.residual < 1e-2;
  std::vector<Complex> values = own;
  if (stays) values = along_eight_periods(monodromy, space, pairs, shift, multipliers.periods);
  if (!finite || values.empty())
  {
    multipliers.stability = Stability::undecided;
    multipliers.would_decide = "the tangent of this period is not finite: other steps a period would decide";
    return result;
  }
  monodromy.flow.record_period(orbit.period, orbit.state, {});
  multipliers.trivial_error = std::max(std::abs(own[shift] - 1.), std::abs(values[shift] - 1.));
  const std::vector<std::size_t> at_later = nearest_places(own, later), at_finer = nearest_places(own, finer);
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  order.erase(order.begin() + static_cast<std::ptrdiff_t>(shift));
  std::ranges::stable_sort(order, std::greater{}, [&](std::size_t i) { return std::abs(values[i]); });
  for (const std::size_t i : order)
  {
    constexpr double rounding = 1e-9;
    const double size = std::abs(values[i]), before = std::abs(own[i]);
    const double bar = bar_of_modulus(before - size, std::abs(later[at_later[i]]) - before,
                                      std::abs(finer[at_finer[i]]) - before, stays && before > decays);
    const double of_grid = before > decays || !stays ? moved_by_grid(multipliers, values[i]) : 0;
    multipliers.values.push_back(values[i]);
    multipliers.errors.push_back(std::max({bar, of_grid, rounding}));
  }
  if (order.empty()) return result;
  decide(multipliers, {true, ""});
  const auto combined = [&](const Eigen::VectorXd& y)
  { return std::move(states_of(combination(space.right, y), orbit.state).front()); };
  result.fastest = fastest_motion(monodromy.flow, pairs[order[deciding_place(multipliers)]], combined);
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
