/// Multipliers by oblique projection (src/README.md, section 6.9). V and W are energy-orthonormal bases of approximate
/// right and left vectors. A pass takes Z = (dPhi_T/dx) V, all columns at once, and
///     mu = eig((W'V)^-1 W'Z),     V <- Z,     bar_i = 2 |mu_i - its last value| + errors_i.
/// Beside V the largest Ritz values of (1 - V (W'V)^-1 W') dPhi_T/dx are sought in a block Arnoldi space: where they
/// lie below 1 by more than their residuals, no larger multiplier is to be expected. That is likely, not proven.
#include "monodromy.hpp"
#include "state_block.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Complex = std::complex<double>;

constexpr double least_part = 1e-10;      // of a direction, or it is dropped: rounding of the energy product's squares
constexpr double largest_condition = 1e6; // of W'V: beyond, an error of 1e-10 in Z is one of 1e-4 in mu
constexpr int passes_at_most = 4;
constexpr Index block_size = 6; // of the search beside V

/// X -> dPhi_T/dx X
StateBlock image_of(const Monodromy& monodromy, const StateBlock& X)
{
  const std::vector<Owned<Vec>> states = states_of(X, monodromy.orbit.state);
  multiply(monodromy, states);
  return block_of(states);
}

/// V (W'V)^-1 W'
struct Projector
{
  StateBlock V, W; // W holds energy images of left vectors
  Eigen::PartialPivLU<MatrixXd> gram{};
};

/// Makes V orthonormal and the projector fit it. Returns the condition of W'V.
double fit(const Flow& flow, Projector& projector)
{
  projector.V = orthonormal(flow, std::move(projector.V), least_part);
  const MatrixXd gram = inner_products(projector.W, projector.V);
  if (gram.rows() != gram.cols()) return HUGE_VAL;
  const Eigen::VectorXd sizes = Eigen::JacobiSVD<MatrixXd>(gram).singularValues();
  projector.gram.compute(gram);
  return sizes.size() == 0 ? 1 : sizes(0) / std::max(sizes(sizes.size() - 1), 1e-300);
}

MatrixXd coefficients(const Projector& projector, const StateBlock& X)
{
  return projector.gram.solve(inner_products(projector.W, X));
}

std::vector<Complex> values_of(const std::vector<DenseEigenpair>& pairs)
{
  std::vector<Complex> values;
  for (const DenseEigenpair& pair : pairs) values.push_back(pair.lambda);
  return values;
}

/// |a - b| of values and their nearest references.
std::vector<double> distances(const std::vector<Complex>& values, const std::vector<Complex>& references)
{
  std::vector<double> result(values.size());
  const std::vector<std::size_t> places = nearest_places(values, references);
  for (std::size_t i = 0; i < values.size(); ++i) result[i] = std::abs(values[i] - references[places[i]]);
  return result;
}

/// The passes: pairs of the last one, in the coordinates of V, and their bars.
struct Passes
{
  Projector projector;
  std::vector<DenseEigenpair> pairs{};
  std::vector<double> bars{};
  long columns = 0;
};

bool reaches_across(const Passes& passes)
{
  for (std::size_t i = 0; i < passes.pairs.size(); ++i)
    if (std::abs(std::abs(passes.pairs[i].lambda) - 1) <= passes.bars[i]) return true;
  return false;
}

/// Removes the shift in time from the pairs. Returns the distance of its multiplier from 1.
double take_out_shift(const Monodromy& monodromy, Passes& passes)
{
  const Owned<Vec> rate = copy_of(monodromy.orbit.rate.get());
  const StateBlock flow = block_of(std::span(&rate, 1));
  const Eigen::VectorXd along = inner_products(passes.projector.V, energy_images(monodromy.flow, flow)).col(0);
  const std::size_t shift = find_shift(passes.pairs, along);
  const double distance = std::abs(passes.pairs[shift].lambda - 1.);
  passes.pairs.erase(passes.pairs.begin() + static_cast<std::ptrdiff_t>(shift));
  passes.bars.erase(passes.bars.begin() + static_cast<std::ptrdiff_t>(shift));
  return distance;
}

/// Two passes or more, until no bar reaches across 1. Returns why the vectors do not serve, or nothing.
std::string make_passes(const Monodromy& monodromy, const SlowMotions& slow, Passes& passes, double& shift_distance)
{
  Projector& projector = passes.projector;
  projector.V = block_of(slow.right);
  projector.W = energy_images(monodromy.flow, orthonormal(monodromy.flow, block_of(slow.left), least_part));
  std::vector<Complex> last = slow.values;
  for (int pass = 1;; ++pass)
  {
    const double condition = fit(monodromy.flow, projector);
    if (!(condition <= largest_condition))
      return format("right and left vectors of the reduced model do not fit together: condition %.0e", condition);
    StateBlock Z = image_of(monodromy, projector.V);
    passes.columns += static_cast<long>(Z.columns());
    passes.pairs = solve_dense_unsymmetric(coefficients(projector, Z));
    const std::vector<Complex> values = values_of(passes.pairs);
    passes.bars = distances(values, last);
    const std::vector<std::size_t> own = nearest_places(values, slow.values);
    for (std::size_t i = 0; i < values.size(); ++i)
      passes.bars[i] = std::max(2 * passes.bars[i] + slow.errors[own[i]], 1e-9);
    shift_distance = take_out_shift(monodromy, passes);
    if (pass == passes_at_most || (pass > 1 && !reaches_across(passes))) return {};
    last = values;
    projector.V = std::move(Z);
  }
}

/// What the search beside V found.
struct Search
{
  bool bounded = false; // its largest Ritz value is below 1 by more than its residual
  Complex largest = 0;  // that value
  double residual = 0;
  long columns = 0;
};

/// X without what lies in V.
void deflate(const Projector& projector, StateBlock& X)
{
  subtract(X, projector.V, coefficients(projector, X));
}

/// The motions that lie least in V, at most a block of them.
StateBlock start_beside(const Monodromy& monodromy, const Projector& projector, const std::vector<Owned<Vec>>& motions)
{
  constexpr double enough = 0.1; // of a motion's norm
  StateBlock X = block_of(motions);
  const auto norms = [&](const StateBlock& of)
  { return Eigen::VectorXd(inner_products(of, energy_images(monodromy.flow, of)).diagonal().cwiseSqrt()); };
  const Eigen::VectorXd before = norms(X);
  deflate(projector, X);
  const Eigen::VectorXd after = norms(X);
  std::vector<Index> taken;
  for (Index k = 0; k < X.columns() && static_cast<Index>(taken.size()) < block_size; ++k)
    if (after(k) > enough * before(k)) taken.push_back(k);
  return {{X.u.comm, X.u.entries(Eigen::all, taken)}, {X.v.comm, X.v.entries(Eigen::all, taken)}};
}

/// Judges the largest Ritz pair of H; `remainder`: of the last block's image, whose columns are the last ones of H.
void judge_ritz(const MatrixXd& H, const MatrixXd& remainder, Search& search)
{
  const DenseEigenpair pair = solve_dense_unsymmetric(H).front();
  search.largest = pair.lambda;
  search.residual = (remainder * pair.y.tail(remainder.cols())).norm();
  search.bounded = std::abs(pair.lambda) + search.residual < 1;
}

/// Block Arnoldi of the deflated matrix, at most so many columns.
Search search_beside(const Monodromy& monodromy, const Projector& projector, const std::vector<Owned<Vec>>& motions,
                     Index columns)
{
  const Flow& flow = monodromy.flow;
  Search search;
  search.bounded = motions.empty(); // V holds every motion that may decay slowly
  if (motions.empty()) return search;
  StateBlock block = orthonormal(flow, start_beside(monodromy, projector, motions), 1e-6);
  search.bounded = block.columns() == 0;
  if (search.bounded) return search;
  StateBlock Q = block;
  MatrixXd H(0, 0);
  while (search.columns + block.columns() <= columns)
  {
    StateBlock image = image_of(monodromy, block);
    search.columns += static_cast<long>(image.columns());
    deflate(projector, image);
    const StateBlock images = energy_images(flow, Q);
    MatrixXd along = MatrixXd::Zero(Q.columns(), block.columns());
    for (int pass = 0; pass < 2; ++pass)
    {
      const MatrixXd more = inner_products(images, image);
      subtract(image, Q, more);
      along += more;
    }
    const Index before = H.rows();
    MatrixXd grown = MatrixXd::Zero(Q.columns(), Q.columns());
    grown.topLeftCorner(before, before) = H;
    grown.rightCols(block.columns()) = along;
    block = orthonormal(flow, image, 1e-8);
    const MatrixXd remainder = inner_products(block, energy_images(flow, image));
    H = std::move(grown);
    judge_ritz(H, remainder, search);
    if (search.bounded || block.columns() == 0) return search;
    // the next block's columns see what this one adds to them
    H.conservativeResizeLike(MatrixXd::Zero(H.rows() + remainder.rows(), H.cols()));
    H.bottomRightCorner(remainder.rows(), remainder.cols()) = remainder;
    append(Q, block);
  }
  return search;
}

Coverage coverage_of(const SlowMotions& slow, const Search& search)
{
  if (!slow.confirmed)
    return {false, "the reduced model has another number of large multipliers with fewer shapes: more modes "
                   "(modes.band) would decide"};
  if (search.bounded) return {true, ""};
  return {false, format("beside the slowest motions a Ritz value of %.4f has a residual of %.1e: a larger "
                        "-cycle_multipliers would decide",
                        std::abs(search.largest), search.residual)};
}

/// Values stay sorted, the largest first.
void add_value(Multipliers& multipliers, Complex value, double error)
{
  const auto place = std::find_if(multipliers.values.begin(), multipliers.values.end(),
                                  [&](Complex other) { return std::abs(other) < std::abs(value); }) -
                     multipliers.values.begin();
  multipliers.values.insert(multipliers.values.begin() + place, value);
  multipliers.errors.insert(multipliers.errors.begin() + place, error);
}

} // namespace

std::optional<FloquetAnalysis> multipliers_by_projection(const Monodromy& monodromy, PetscInt columns,
                                                         std::string& refusal)
{
  const Orbit& orbit = monodromy.orbit;
  const SlowMotions slow = monodromy.flow.slow_motions(orbit.period, orbit.state);
  refusal = slow.missing;
  if (!refusal.empty()) return std::nullopt;
  FloquetAnalysis result;
  Multipliers& multipliers = result.multipliers;
  multipliers.method = MultiplierMethod::oblique;
  Passes passes;
  refusal = make_passes(monodromy, slow, passes, multipliers.trivial_error);
  if (!refusal.empty()) return std::nullopt;
  const Index limit = columns > 0 ? columns : 96;
  const Search search = search_beside(monodromy, passes.projector, slow.others, limit);
  multipliers.values = values_of(passes.pairs);
  multipliers.errors = passes.bars;
  if (std::abs(search.largest) - 2 * search.residual > 1) add_value(multipliers, search.largest, 2 * search.residual);
  multipliers.periods = slow.periods + passes.columns + search.columns;
  decide(multipliers, coverage_of(slow, search), multipliers.values.size());
  if (passes.pairs.empty()) return result;
  const MatrixXd fastest = real_part(passes.pairs.front().y);
  result.fastest = std::move(states_of(combination(passes.projector.V, fastest), orbit.state).front());
  normalise(monodromy.flow, result.fastest);
  return result;
}

} // namespace squeal
