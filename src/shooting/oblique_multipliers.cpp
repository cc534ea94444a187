/// Multipliers by oblique projection (src/README.md, section 6.9). V and W are energy-orthonormal bases of approximate
/// right and left vectors. A pass takes Z = (dPhi_T/dx) V, all columns at once, and
///     mu = eig((W'V)^-1 W'Z),     bar_i = 2 |mu_i - its last value| + errors_i.
/// Blocks of passes make a Krylov space: V becomes those of its Ritz vectors whose values are nearest to mu.
/// Beside V the largest Ritz values of (1 - V (W'V)^-1 W') dPhi_T/dx are sought in a block Arnoldi space: where they
/// lie below 1 by more than their residuals, no larger multiplier is to be expected. That is likely, not proven.
#include "monodromy.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "state_block.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/QR>
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
  Eigen::ColPivHouseholderQR<MatrixXd> gram{};
};

/// Makes the projector fit V, which is orthonormal. Returns the condition of W'V.
double fit(Projector& projector)
{
  const MatrixXd gram = inner_products(projector.W, projector.V);
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
  std::vector<double> bars{}, rises{}; // rises: the bars upwards
  std::vector<Complex> values{};       // with that of the shift in time
  double shift_distance = 0;           // of that one from 1
  long columns = 0;
};

bool reaches_across(const Passes& passes)
{
  for (std::size_t i = 0; i < passes.pairs.size(); ++i)
  {
    const double size = std::abs(passes.pairs[i].lambda);
    if (size - passes.bars[i] <= 1 && size + passes.rises[i] >= 1) return true;
  }
  return false;
}

/// Removes the shift in time from the pairs. Where it has met another real multiplier in a complex pair, the sum of
/// both is the pair's: the other one stays. Returns the distance of the shift's multiplier from 1.
double take_out_shift(const Monodromy& monodromy, Passes& passes)
{
  const Owned<Vec> rate = copy_of(monodromy.orbit.rate.get());
  const StateBlock flow = block_of(std::span(&rate, 1));
  const Eigen::VectorXd along = inner_products(passes.projector.V, energy_images(monodromy.flow, flow)).col(0);
  const std::size_t shift = find_shift(passes.pairs, along);
  const Complex value = passes.pairs[shift].lambda;
  const double distance = std::abs(value - 1.);
  if (value.imag() != 0)
    for (std::size_t i = 0; i < passes.pairs.size(); ++i)
      if (passes.pairs[i].lambda == std::conj(value))
      {
        passes.pairs[i].lambda = 2 * value.real() - 1;
        passes.bars[i] += distance;
        passes.rises[i] += distance;
      }
  passes.pairs.erase(passes.pairs.begin() + static_cast<std::ptrdiff_t>(shift));
  for (std::vector<double>* bars : {&passes.bars, &passes.rises})
    bars->erase(bars->begin() + static_cast<std::ptrdiff_t>(shift));
  return distance;
}

/// Whether values that matter still change so much that they cannot be taken for multipliers.
bool meaningless(const std::vector<Complex>& values, const std::vector<double>& changes)
{
  for (std::size_t i = 0; i < values.size(); ++i)
    if (std::abs(values[i]) > 0.95 && changes[i] > 0.05) return true; // as far as 1 is from there
  return false;
}

/// An energy-orthonormal basis, its image and the monodromy matrix on it.
struct KrylovSpace
{
  StateBlock Q, image;
  MatrixXd H;
};

/// Takes in a block and applies the monodromy matrix to what is new of it.
void extend(const Monodromy& monodromy, StateBlock block, KrylovSpace& space)
{
  const Flow& flow = monodromy.flow;
  if (space.H.rows() > 0)
    for (int pass = 0; pass < 2; ++pass) // the second removes what rounding left
      subtract(block, space.Q, inner_products(energy_images(flow, space.Q), block));
  block = orthonormal(flow, std::move(block), 1e-8);
  if (block.columns() == 0) return;
  StateBlock image = image_of(monodromy, block);
  if (space.H.rows() == 0)
  {
    space.Q = std::move(block);
    space.image = std::move(image);
  }
  else
  {
    append(space.Q, block);
    append(space.image, image);
  }
  space.H = inner_products(energy_images(flow, space.Q), space.image);
}

/// Real columns that span the Ritz vectors of the values nearest to these.
MatrixXd nearest_ritz_vectors(const MatrixXd& H, const std::vector<Complex>& values)
{
  const std::vector<DenseEigenpair> ritz = solve_dense_unsymmetric(H);
  MatrixXd result(H.rows(), static_cast<Index>(values.size()));
  Index column = 0;
  for (const std::size_t place : nearest_places(values, values_of(ritz)))
    result.col(column++) =
        ritz[place].lambda.imag() < 0 ? Eigen::VectorXd(-ritz[place].y.imag()) : Eigen::VectorXd(ritz[place].y.real());
  return result;
}

/// Values, bars and pairs of the projection on V, the columns U of the space.
std::string project(const Monodromy& monodromy, const SlowMotions& slow, const KrylovSpace& space, const MatrixXd& U,
                    const std::vector<Complex>& last, Passes& passes)
{
  Projector& projector = passes.projector;
  projector.V = combination(space.Q, U);
  const double condition = fit(projector);
  if (!(condition <= largest_condition))
    return format("right and left vectors of the reduced model do not fit together: condition %.0e", condition);
  passes.pairs = solve_dense_unsymmetric(coefficients(projector, combination(space.image, U)));
  passes.values = values_of(passes.pairs);
  passes.bars = distances(passes.values, last);
  if (passes.columns > static_cast<long>(slow.right.size()) && meaningless(passes.values, passes.bars))
    return "the reduced model's multipliers differ too much from the full model's";
  const std::vector<std::size_t> own = nearest_places(passes.values, slow.values);
  passes.rises = passes.bars;
  for (std::size_t i = 0; i < own.size(); ++i)
  {
    passes.bars[i] = std::max(2 * passes.bars[i] + slow.errors[own[i]], 1e-9);
    passes.rises[i] = std::max(2 * passes.rises[i] + slow.rises[own[i]], 1e-9);
  }
  passes.shift_distance = take_out_shift(monodromy, passes);
  return {};
}

/// Two passes or more, until no bar reaches across 1. Returns why the vectors do not serve, or nothing.
std::string make_passes(const Monodromy& monodromy, const SlowMotions& slow, Passes& passes)
{
  passes.projector.W = energy_images(monodromy.flow, orthonormal(monodromy.flow, block_of(slow.left), least_part));
  KrylovSpace space;
  StateBlock block = block_of(slow.right);
  std::vector<Complex> last = slow.values;
  for (int pass = 1;; ++pass)
  {
    const Index before = space.H.rows();
    extend(monodromy, std::move(block), space);
    passes.columns = static_cast<long>(space.H.rows());
    const MatrixXd U = pass == 1 ? MatrixXd::Identity(space.H.rows(), space.H.cols()).eval()
                                 : orthonormal_columns(nearest_ritz_vectors(space.H, last));
    if (std::string refusal = project(monodromy, slow, space, U, last, passes); !refusal.empty()) return refusal;
    if (pass == passes_at_most || space.H.rows() == before || (pass > 1 && !reaches_across(passes))) return {};
    last = passes.values;
    block = {columns_from(space.image.u, before), columns_from(space.image.v, before)};
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
  multipliers.upper.insert(multipliers.upper.begin() + place, std::abs(value) + error);
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
  refusal = make_passes(monodromy, slow, passes);
  if (!refusal.empty()) return std::nullopt;
  multipliers.trivial_error = passes.shift_distance;
  const Index limit = columns > 0 ? columns : 96;
  const Search search = search_beside(monodromy, passes.projector, slow.others, limit);
  multipliers.values = values_of(passes.pairs);
  multipliers.errors = passes.bars;
  for (std::size_t i = 0; i < passes.rises.size(); ++i)
    multipliers.upper.push_back(std::abs(multipliers.values[i]) + passes.rises[i]);
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
