#include "deflated_search.hpp"

#include "squeal/algebra/dense_matrix.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

constexpr Index of_block = 6; // columns
// Few powers of few motions may be bounded where another one grows: the residual of a Ritz value says nothing of what
// the space has not. Four blocks have seen what every motion of a random start becomes in four periods.
constexpr long least_blocks = 4;

/// Whether the images of the space lie in it, so that its pairs are exact.
bool is_invariant(const MatrixXd& remainder, const MatrixXd& along)
{
  constexpr double rounding = 1e-12;
  return remainder.rows() == 0 || remainder.norm() <= rounding * along.norm();
}

/// Sets the largest pair of H. `remainder`: of the last block's image, whose columns are the last ones of H.
void set_pair(const MatrixXd& H, const MatrixXd& remainder, DeflatedSearch& search)
{
  search.pair = solve_dense_unsymmetric(H).front();
  search.residual = (remainder * search.pair.y.tail(remainder.cols())).norm();
  search.bounded = std::abs(search.pair.lambda) + search.residual < 1;
}

} // namespace

DeflatedSearch search_beside(const Monodromy& monodromy, const Deflation& deflation, Index columns)
{
  const Flow& flow = monodromy.flow;
  DeflatedSearch search;
  constexpr double known = 1e-3; // residual that a projection goes on from
  MultiVector velocities = random_multivector(flow.M, of_block), none = velocities;
  none.entries.setZero();
  StateBlock block{std::move(none), std::move(velocities)}; // in which every mode has its part
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
    set_pair(H, remainder, search);
    const bool ends = search.bounded || search.residual < known;
    if (is_invariant(remainder, along) || (blocks >= least_blocks && ends)) return search;
    if (search.columns + block.columns() > columns) return search;
    // the next block's columns see what this one adds to them
    H.conservativeResizeLike(MatrixXd::Zero(H.rows() + remainder.rows(), H.cols()));
    H.bottomRightCorner(remainder.rows(), remainder.cols()) = remainder;
    append(search.Q, block);
  }
}

} // namespace squeal
