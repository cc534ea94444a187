#include "deflated_search.hpp"

#include "squeal/algebra/dense_matrix.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;

constexpr Index of_block = 6, at_random = 2; // columns, and those that are random at least
// Few powers of few motions may be bounded where another one grows: the residual of a Ritz value says nothing of what
// the space has not. Four blocks have seen what every motion of a random start becomes in four periods.
constexpr long least_blocks = 4;

/// The first motions, and random velocities, in which every mode has its part.
StateBlock start_beside(const Monodromy& monodromy, const std::vector<Owned<Vec>>& motions)
{
  const auto given = std::min(motions.size(), static_cast<std::size_t>(of_block - at_random));
  MultiVector velocities = random_multivector(monodromy.flow.M, of_block - static_cast<Index>(given)),
              none = velocities;
  none.entries.setZero();
  StateBlock start{std::move(none), std::move(velocities)};
  if (given > 0) append(start, block_of(std::span(motions).first(given)));
  return start;
}

/// Whether the images of the space lie in it, so that its pairs are exact.
bool is_invariant(const MatrixXd& remainder, const MatrixXd& along)
{
  constexpr double rounding = 1e-12;
  return remainder.rows() == 0 || remainder.norm() <= rounding * along.norm();
}

/// Sets the pair that is sought among those of H. `remainder`: of the last block's image, whose columns are the last
/// ones of H.
void set_pair(const MatrixXd& H, const MatrixXd& remainder, const SearchChoice& choice, DeflatedSearch& search)
{
  const std::vector<DenseEigenpair> pairs = solve_dense_unsymmetric(H);
  search.pair = pairs[choice.place(pairs, search.Q)];
  search.residual = (remainder * search.pair.y.tail(remainder.cols())).norm();
  search.bounded = std::abs(search.pair.lambda) + search.residual < 1;
}

} // namespace

DeflatedSearch search_beside(const Monodromy& monodromy, const Deflation& deflation,
                             const std::vector<Owned<Vec>>& motions, Index columns, const SearchChoice& choice)
{
  const Flow& flow = monodromy.flow;
  DeflatedSearch search;
  StateBlock block = start_beside(monodromy, motions);
  deflation(block);
  block = orthonormal(flow, std::move(block), 1e-6);
  search.bounded = block.columns() == 0;
  if (search.bounded) return search;
  search.Q = block;
  MatrixXd H(0, 0);
  for (long blocks = 1;; ++blocks)
  {
    StateBlock image = image_of(monodromy, block);
    search.columns += static_cast<long>(image.columns());
    deflation(image);
    const StateBlock images = energy_images(flow, search.Q);
    MatrixXd along = MatrixXd::Zero(search.Q.columns(), block.columns());
    for (int pass = 0; pass < 2; ++pass)
    {
      const MatrixXd more = inner_products(images, image);
      subtract(image, search.Q, more);
      along += more;
    }
    MatrixXd grown = MatrixXd::Zero(search.Q.columns(), search.Q.columns());
    grown.topLeftCorner(H.rows(), H.cols()) = H;
    grown.rightCols(block.columns()) = along;
    H = std::move(grown);
    block = orthonormal(flow, image, 1e-8);
    const MatrixXd remainder = inner_products(block, energy_images(flow, image));
    set_pair(H, remainder, choice, search);
    if (is_invariant(remainder, along) || (blocks >= least_blocks && choice.ends(search))) return search;
    if (search.columns + block.columns() > columns) return search;
    // the next block's columns see what this one adds to them
    H.conservativeResizeLike(MatrixXd::Zero(H.rows() + remainder.rows(), H.cols()));
    H.bottomRightCorner(remainder.rows(), remainder.cols()) = remainder;
    append(search.Q, block);
  }
}

FloquetAnalysis multipliers_by_search(const Monodromy& monodromy, const std::vector<Owned<Vec>>& motions, Index columns)
{
  const Flow& flow = monodromy.flow;
  const Orbit& orbit = monodromy.orbit;
  FloquetAnalysis result;
  Multipliers& multipliers = result.multipliers;
  multipliers.method = MultiplierMethod::arnoldi;
  const Owned<Vec> rate = copy_of(orbit.rate.get());
  const StateBlock rate_image = energy_images(flow, block_of(std::span(&rate, 1)));
  double shift_distance = 0;
  const auto beside_shift = [&](const std::vector<DenseEigenpair>& pairs, const StateBlock& Q) -> std::size_t
  {
    const std::size_t shift = find_shift(pairs, inner_products(Q, rate_image).col(0));
    shift_distance = std::abs(pairs[shift].lambda - 1.);
    return shift == 0 && pairs.size() > 1 ? 1 : 0;
  };
  const auto settled = [](const DeflatedSearch& search)
  { return search.residual < 0.1 * std::abs(std::abs(search.pair.lambda) - 1); };
  const auto search_on = [&](const TimeGrid& grid)
  {
    flow.record_period(orbit.period, orbit.state, grid);
    const Deflation nothing = [](StateBlock&) {};
    DeflatedSearch search = search_beside(monodromy, nothing, motions, columns, {beside_shift, settled});
    multipliers.periods += search.columns;
    return search;
  };
  const DeflatedSearch found = search_on({});
  multipliers.trivial_error = shift_distance;
  const Complex largest = found.pair.lambda;
  GridErrors errors(1);
  for (const auto& [grid, part] : other_grids)
  {
    const DeflatedSearch other = search_on(grid);
    add_changes({largest}, {other.pair.lambda, std::conj(other.pair.lambda)}, part, errors);
    for (std::vector<double>* bar : {&errors.errors, &errors.rises}) bar->front() += part * other.residual;
  }
  flow.record_period(orbit.period, orbit.state, {});
  const double own = std::max(2 * found.residual, 1e-9); // rounding
  multipliers.values = {largest};
  if (largest.imag() != 0) multipliers.values.push_back(std::conj(largest));
  multipliers.errors.assign(multipliers.values.size(), own + errors.errors.front());
  multipliers.upper.assign(multipliers.values.size(), std::abs(largest) + own + errors.rises.front());
  decide(multipliers,
         {settled(found), "the largest multiplier has not converged: a larger -cycle_multipliers would decide"});
  const auto combined = [&](const Eigen::VectorXd& y)
  { return std::move(states_of(combination(found.Q, y), orbit.state).front()); };
  result.fastest = fastest_motion(flow, found.pair, combined);
  return result;
}

} // namespace squeal
