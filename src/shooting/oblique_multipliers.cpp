/// Multipliers by oblique projection (src/README.md, section 6.9). Q is an energy-orthonormal basis, of approximate
/// right vectors and the flow at first; W holds as many energy images, of approximate left vectors and of what else Q
/// has:
///     A = dPhi_T/dx,     (W'Q)^-1 W'A Q y = m y,     bar_i = 2 |m_i - its last value| + errors_i.
/// Where a bar reaches across 1, Q takes in (A_r - m)^-1 (A - m) Q y, A_r the reduced model's matrix (Davidson
/// 1975). The largest Ritz values of A beside V = Q y, and beside what A_r knows, are sought in a block Arnoldi space.
/// Where they are below 1 by more than their residuals, no larger multiplier is to be expected. That is likely, not
/// proven.
#include "monodromy.hpp"
#include "squeal/base/cost.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace squeal
{

namespace
{

constexpr double largest_condition = 1e6; // of W'V: beyond, an error of 1e-10 in Z is one of 1e-4 in mu
// A pass leaves some 0.6 of the error. Where periods are dear and the bar holds more, 8 are enough.
constexpr int most_passes = 24, most_dear_passes = 8;

/// The passes: what the last one found of each wanted value, in the order of the reduced model's.
struct Passes
{
  Projector space{};                        // its V is Q
  StateBlock image{};                       // A Q
  Projector wanted{};                       // on the wanted vectors alone
  std::vector<DenseEigenpair> pairs{};      // vectors in the coordinates of Q; first the reduced model's
  std::vector<double> changes{};            // when a pair was refined last
  std::vector<double> grid{}, grid_rises{}; // what the grid of time changes; of newcomers the most that is known
  std::vector<double> bars{}, rises{};      // rises: the bars upwards
  std::size_t shift = 0;                    // the place of the shift in time; the number of pairs: it is not there
  DenseEigenpair shift_pair{};              // the shift itself
  double shift_distance = 0;                // of its multiplier from 1
};

/// Whether a bar, or what a modulus may rise by, reaches across 1.
bool reaches_across(const Passes& passes, std::size_t i)
{
  const double size = std::abs(passes.pairs[i].lambda);
  return i != passes.shift && size - passes.bars[i] <= 1 && size + passes.rises[i] >= 1;
}

/// Takes in what is new of a block, which it returns, and tests by its energy image.
StateBlock take_in(const Flow& flow, StateBlock block, Projector& space)
{
  for (int pass = 0; pass < 2; ++pass) // the second removes what rounding left
    subtract(block, space.V, inner_products(energy_images(flow, space.V), block));
  block = orthonormal(flow, std::move(block), 1e-8);
  if (block.columns() == 0) return block;
  append(space.V, block);
  append(space.W, energy_images(flow, block));
  return block;
}

/// Takes in a block and its image. Returns the number of columns that are new.
Index extend(const Monodromy& monodromy, StateBlock block, Passes& passes)
{
  block = take_in(monodromy.flow, std::move(block), passes.space);
  if (block.columns() > 0) append(passes.image, image_of(monodromy, block));
  return block.columns();
}

/// Q and W of the reduced model's vectors and of the flow, and all images at once: each passage through the period
/// costs its contact anew. Returns why the vectors do not serve, or nothing.
std::string begin_passes(const Monodromy& monodromy, const SlowMotions& slow, Passes& passes)
{
  const Flow& flow = monodromy.flow;
  Projector& space = passes.space;
  space.V = orthonormal(flow, block_of(slow.right), least_part);
  space.W = energy_images(flow, orthonormal(flow, block_of(slow.left), least_part));
  passes.grid = slow.errors;
  passes.grid_rises = slow.rises;
  if (const double condition = fit(space); !(condition <= largest_condition))
    return format("right and left vectors of the reduced model do not fit together: condition %.0e", condition);
  const Owned<Vec> rate = copy_of(monodromy.orbit.rate.get());
  take_in(flow, block_of(std::span(&rate, 1)), space);
  passes.image = image_of(monodromy, space.V);
  return {};
}

/// Places in `all` of values that may be multipliers next to 1 or above and that nobody has taken: the reduced model
/// has none like them.
std::vector<std::size_t> newcomers(const std::vector<DenseEigenpair>& all, const std::vector<std::size_t>& taken,
                                   std::size_t shift)
{
  constexpr double large = 0.95;
  std::vector<std::size_t> places;
  for (std::size_t k = 0; k < all.size(); ++k)
    if (k != shift && std::abs(all[k].lambda) > large && std::ranges::find(taken, k) == taken.end())
      places.push_back(k);
  return places;
}

/// The wanted pairs and their bars. `refined`: those that the last block was made for; empty: all.
void project(const Monodromy& monodromy, const SlowMotions& slow, const std::vector<std::size_t>& refined,
             Passes& passes)
{
  Projector& space = passes.space;
  fit(space);
  const std::vector<DenseEigenpair> all = solve_dense_unsymmetric(coefficients(space, passes.image));
  const std::vector<Complex> last = passes.pairs.empty() ? slow.values : values_of(passes.pairs);
  std::vector<std::size_t> places = nearest_places(last, values_of(all));
  const Owned<Vec> rate = copy_of(monodromy.orbit.rate.get());
  const StateBlock flow = block_of(std::span(&rate, 1));
  const std::size_t shift = find_shift(all, inner_products(space.V, energy_images(monodromy.flow, flow)).col(0));
  passes.shift_pair = all[shift];
  passes.shift_distance = std::abs(passes.shift_pair.lambda - 1.);
  passes.pairs.clear();
  passes.changes.resize(last.size(), 0);
  for (std::size_t i = 0; i < last.size(); ++i)
  {
    const double change = std::abs(all[places[i]].lambda - last[i]);
    const bool own = refined.empty() || std::find(refined.begin(), refined.end(), i) != refined.end();
    passes.changes[i] = own ? change : std::max(passes.changes[i], change);
  }
  for (const std::size_t place : newcomers(all, places, shift))
  {
    places.push_back(place);
    passes.changes.push_back(1); // not known
    for (std::vector<double>* part : {&passes.grid, &passes.grid_rises})
      part->push_back(part->empty() ? 0 : *std::ranges::max_element(*part));
  }
  passes.shift = places.size();
  passes.bars.assign(places.size(), 0);
  passes.rises = passes.bars;
  for (std::size_t i = 0; i < places.size(); ++i)
  {
    passes.pairs.push_back(all[places[i]]);
    if (places[i] == shift) passes.shift = i;
    passes.bars[i] = std::max(2 * passes.changes[i] + passes.grid[i], 1e-9);
    passes.rises[i] = std::max(2 * passes.changes[i] + passes.grid_rises[i], 1e-9);
  }
}

/// Whether some value is above 1 by more than its margin.
bool is_above(const Passes& passes, const std::vector<double>& margins)
{
  for (std::size_t i = 0; i < passes.pairs.size(); ++i)
    if (i != passes.shift && std::abs(passes.pairs[i].lambda) - margins[i] > 1) return true;
  return false;
}

bool repels(const Passes& passes)
{
  return is_above(passes, passes.bars);
}

/// The pairs that decide: the largest, and those whose bars reach across 1. The latter are left out where one is above
/// 1 beyond its bar or, with `alone`, by more than the grid of time changes.
std::vector<std::size_t> deciding_pairs(const Passes& passes, bool alone)
{
  const bool may_decide = alone ? is_above(passes, passes.grid) : repels(passes);
  double largest = 0;
  for (std::size_t i = 0; i < passes.pairs.size(); ++i)
    if (i != passes.shift) largest = std::max(largest, std::abs(passes.pairs[i].lambda));
  std::vector<std::size_t> deciding;
  for (std::size_t i = 0; i < passes.pairs.size(); ++i)
    if (i != passes.shift &&
        ((!may_decide && reaches_across(passes, i)) || std::abs(passes.pairs[i].lambda) > largest - 1e-9))
      deciding.push_back(i);
  return deciding;
}

/// (A_r - m)^-1 (A - m) Q y of the pairs, real and imaginary parts.
StateBlock corrections(const Monodromy& monodromy, const SlowMotions& slow, const std::vector<std::size_t>& refined,
                       const Passes& passes)
{
  MatrixXd of_image(passes.image.columns(), 0), of_Q = of_image;
  std::vector<Complex> values;
  for (const std::size_t i : refined)
  {
    const DenseEigenpair& pair = passes.pairs[i];
    if (std::find(values.begin(), values.end(), std::conj(pair.lambda)) != values.end()) continue; // the same parts
    values.push_back(pair.lambda);
    const Eigen::VectorXcd turned = pair.lambda * pair.right;
    of_image.conservativeResize(Eigen::NoChange, of_image.cols() + 2);
    of_Q.conservativeResize(Eigen::NoChange, of_Q.cols() + 2);
    of_image.rightCols(2) << pair.right.real(), pair.right.imag();
    of_Q.rightCols(2) << turned.real(), turned.imag();
  }
  StateBlock residuals = combination(passes.image, of_image);
  subtract(residuals, passes.space.V, of_Q);
  const std::vector<Owned<Vec>> states = states_of(residuals, monodromy.orbit.state);
  for (std::size_t k = 0; k < values.size(); ++k) slow.correct(values[k], states[2 * k], states[2 * k + 1]);
  return block_of(states);
}

/// The wanted pairs and the shift in time, complex pairs whole.
std::vector<DenseEigenpair> with_shift(const Passes& passes)
{
  std::vector<DenseEigenpair> pairs = passes.pairs;
  if (passes.shift < pairs.size()) return pairs;
  const DenseEigenpair& shift = passes.shift_pair;
  pairs.push_back(shift);
  const std::vector<Complex> values = values_of(passes.pairs);
  if (shift.lambda.imag() != 0 && std::ranges::find(values, std::conj(shift.lambda)) == values.end())
    pairs.push_back({std::conj(shift.lambda), shift.right.conjugate()});
  return pairs;
}

/// The projector on the wanted vectors, along their left ones: with C = (W'Q)^-1 W'A Q and z'C = m z' these act as
/// z'(W'Q)^-1 W'.
void set_wanted(const Monodromy& monodromy, Passes& passes)
{
  Projector& space = passes.space;
  const MatrixXd C = coefficients(space, passes.image), gram = inner_products(space.W, space.V);
  const std::vector<DenseEigenpair> adjoint = solve_dense_unsymmetric(C.transpose());
  const std::vector<DenseEigenpair> right = with_shift(passes);
  std::vector<DenseEigenpair> left;
  for (const std::size_t place : nearest_places(values_of(right), values_of(adjoint))) left.push_back(adjoint[place]);
  const Index size = space.V.columns();
  passes.wanted.V = orthonormal(monodromy.flow, combination(space.V, real_columns(right, size)), least_part);
  passes.wanted.W = combination(space.W, gram.transpose().colPivHouseholderQr().solve(real_columns(left, size)));
  fit(passes.wanted);
}

/// Whether values that matter still change so much that they cannot be taken for multipliers.
bool meaningless(const Passes& passes)
{
  for (std::size_t i = 0; i < passes.pairs.size(); ++i)
    if (i != passes.shift && std::abs(passes.pairs[i].lambda) > 0.95 && passes.changes[i] > 0.05)
      return true; // as far as 1 is from there
  return false;
}

/// Two passes or more, until the pairs that decide have settled. The first change of all is the reduced model's error,
/// and says little of what the projection has. Returns why the vectors do not serve, or nothing.
std::string make_passes(const Monodromy& monodromy, const SlowMotions& slow, Passes& passes)
{
  const bool first = passes.pairs.empty();
  constexpr double settled = 2.5e-7; // what other ranks or starts may add up to: below 1e-6
  const bool dear = is_dear(monodromy.flow.work);
  const auto is_settled = [&](std::size_t i)
  {
    if (!dear) return passes.changes[i] <= settled;
    const double beyond = std::abs(passes.pairs[i].lambda) - 1;
    if (beyond > passes.bars[i] && 2 * passes.changes[i] <= 0.1 * beyond) return true;
    // of the grid's error, which the bar holds as well: as much as that, where the verdict stands already
    const double part = reaches_across(passes, i) ? 0.05 : 0.5;
    return passes.changes[i] <= std::max(settled, part * passes.grid[i]);
  };
  std::vector<std::size_t> refined;
  for (int pass = 1;; ++pass)
  {
    project(monodromy, slow, refined, passes);
    for (const bool alone : {true, false})
    {
      refined = deciding_pairs(passes, alone);
      if (pass > 1 || !first) std::erase_if(refined, is_settled);
      if (!refined.empty()) break;
    }
    if (refined.empty() || pass == (dear ? most_dear_passes : most_passes)) break;
    if (extend(monodromy, corrections(monodromy, slow, refined, passes), passes) == 0) break;
  }
  if (meaningless(passes) && !repels(passes))
    return "the reduced model's multipliers differ too much from the full model's";
  set_wanted(monodromy, passes);
  return {};
}

/// Removes the shift in time from the pairs. Where it met another real multiplier in a complex pair, the sum of both is
/// the pair's. The other one stays, or comes where it was not among the pairs.
void take_out_shift(Passes& passes)
{
  const std::size_t place = passes.shift, count = passes.pairs.size();
  const Complex value = passes.shift_pair.lambda;
  if (value.imag() != 0)
  {
    std::size_t other = 0;
    while (other < count && passes.pairs[other].lambda != std::conj(value)) ++other;
    if (other == count)
    {
      passes.pairs.push_back({std::conj(value), passes.shift_pair.right.conjugate()});
      passes.bars.push_back(0);
      passes.rises.push_back(0);
    }
    passes.pairs[other].lambda = 2 * value.real() - 1;
    // 1 and 2 Re m - 1 have the sum of both; their product is off by |m - 1|^2, and so are the entries behind it
    passes.bars[other] += passes.shift_distance * passes.shift_distance;
    passes.rises[other] += passes.shift_distance * passes.shift_distance;
  }
  if (place == count) return;
  passes.pairs.erase(passes.pairs.begin() + static_cast<std::ptrdiff_t>(place));
  for (std::vector<double>* bars : {&passes.bars, &passes.rises})
    bars->erase(bars->begin() + static_cast<std::ptrdiff_t>(place));
}

/// Whether the values of the approximation that were not refined stay below 1 by twice the largest error of those that
/// were.
bool others_decay(const SlowMotions& slow, const Passes& passes)
{
  double error = 0;
  for (std::size_t i = 0; i < slow.values.size(); ++i)
    error = std::max(error, std::abs(passes.pairs[i].lambda - slow.values[i]));
  return slow.next + 2 * error < 1;
}

/// Takes out the wanted vectors, after what the approximation knows where its other values can be relied on.
Deflation beside_known(const Monodromy& monodromy, const SlowMotions& slow, const Passes& passes)
{
  return [&, reliable = others_decay(slow, passes)](StateBlock& X)
  {
    if (reliable)
    {
      const std::vector<Owned<Vec>> states = states_of(X, monodromy.orbit.state);
      for (const Owned<Vec>& state : states) slow.without_known(state);
      X = block_of(states);
    }
    deflate(passes.wanted, X);
  };
}

/// Why larger multipliers are to be expected; empty: there are none.
std::string missing_beside(const DeflatedSearch& search)
{
  if (search.bounded) return {};
  return format("beside the slowest motions a Ritz value of %.4f has a residual of %.1e: a larger -cycle_multipliers "
                "would decide",
                std::abs(search.pair.lambda), search.residual);
}

/// The passes, and the search beside them. What that finds joins Q. A motion that the reduced model has not becomes one
/// of the pairs; what comes of pairs that have not settled goes. Returns why the vectors do not serve, or nothing.
std::string make_complete(const Monodromy& monodromy, const SlowMotions& slow, Index columns, Passes& passes,
                          std::string& missing, long& searched)
{
  constexpr int rounds = 3;
  if (std::string refusal = begin_passes(monodromy, slow, passes); !refusal.empty()) return refusal;
  for (int round = 1;; ++round)
  {
    if (std::string refusal = make_passes(monodromy, slow, passes); !refusal.empty()) return refusal;
    missing.clear(); // a multiplier above 1 needs no other
    if (repels(passes)) return {};
    DeflatedSearch search{true}; // an exact approximation lacks nothing
    if (slow.without_known) search = search_beside(monodromy, beside_known(monodromy, slow, passes), columns);
    searched += search.columns;
    missing = missing_beside(search);
    if (search.bounded || round == rounds) return {};
    if (extend(monodromy, combination(search.Q, parts_of(search.pair.right)), passes) == 0) return {};
  }
}

} // namespace

FloquetAnalysis multipliers_by_projection(const Monodromy& monodromy, PetscInt columns)
{
  const Orbit& orbit = monodromy.orbit;
  FloquetAnalysis result;
  Multipliers& multipliers = result.multipliers;
  multipliers.method = MultiplierMethod::oblique;
  const auto undecided = [&](const std::string& reason)
  {
    multipliers.stability = Stability::undecided;
    multipliers.complete = false;
    multipliers.would_decide = reason;
    return std::move(result);
  };
  if (!monodromy.flow.slow_motions) return undecided("no approximate vectors are known");
  const SlowMotions slow = monodromy.flow.slow_motions(orbit.period, orbit.state);
  if (!slow.missing.empty()) return undecided(slow.missing);
  Passes passes;
  std::string missing;
  const std::string refusal =
      make_complete(monodromy, slow, columns > 0 ? columns : 96, passes, missing, multipliers.periods);
  if (!refusal.empty()) return undecided(refusal);
  take_out_shift(passes);
  multipliers.trivial_error = passes.shift_distance;
  multipliers.periods += slow.periods + static_cast<long>(passes.image.columns());
  std::vector<std::size_t> order(passes.pairs.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b)
                   { return std::abs(passes.pairs[a].lambda) > std::abs(passes.pairs[b].lambda); });
  for (const std::size_t i : order)
  {
    multipliers.values.push_back(passes.pairs[i].lambda);
    multipliers.errors.push_back(passes.bars[i]);
    multipliers.upper.push_back(std::abs(passes.pairs[i].lambda) + passes.rises[i]);
  }
  decide(multipliers, missing);
  if (passes.pairs.empty()) return result;
  const auto combined = [&](const Eigen::VectorXd& y)
  { return std::move(states_of(combination(passes.space.V, y), orbit.state).front()); };
  result.fastest = fastest_motion(monodromy.flow, passes.pairs[order[deciding_place(multipliers)]], combined);
  return result;
}

} // namespace squeal
