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

constexpr Index of_motions = 4, at_random = 2; // columns of a block
// Few powers of few motions may be bounded where another one grows: the residual of a Ritz value says nothing of what
// the space has not. Four blocks have seen what every motion of a random start becomes in four periods.
constexpr long least_blocks = 4;
constexpr double ritz_settled = 1e-3; // residual of a value that the projection may go on from

/// The motions that are least in V, and random velocities, in which every mode has its part.
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
  for (Index k = 0; k < X.columns() && static_cast<Index>(taken.size()) < of_motions; ++k)
    if (after(k) > enough * before(k)) taken.push_back(k);
  StateBlock start{{X.u.comm, X.u.entries(Eigen::all, taken)}, {X.v.comm, X.v.entries(Eigen::all, taken)}};
  MultiVector velocities = random_multivector(monodromy.flow.M, at_random), none = velocities;
  none.entries.setZero();
  StateBlock random{std::move(none), std::move(velocities)};
  deflate(projector, random);
  append(start, random);
  return start;
}

/// Bounds the largest Ritz pair of H on Q. `remainder`: of the last block's image, whose columns are the last ones of
/// H.
void bound_ritz(const StateBlock& Q, const MatrixXd& H, const MatrixXd& remainder, DeflatedSearch& search)
{
  const DenseEigenpair pair = solve_dense_unsymmetric(H).front();
  search.largest = pair.lambda;
  search.residual = (remainder * pair.y.tail(remainder.cols())).norm();
  search.bounded = std::abs(pair.lambda) + search.residual < 1;
  search.vector.reset();
  if (search.bounded) return;
  search.vector = combination(Q, parts_of(pair.y));
}

} // namespace

DeflatedSearch search_beside(const Monodromy& monodromy, const Projector& projector,
                             const std::vector<Owned<Vec>>& motions, Index columns)
{
  const Flow& flow = monodromy.flow;
  DeflatedSearch search;
  search.bounded = motions.empty(); // V holds every motion that may decay slowly
  if (motions.empty()) return search;
  StateBlock block = orthonormal(flow, start_beside(monodromy, projector, motions), 1e-6);
  search.bounded = block.columns() == 0;
  if (search.bounded) return search;
  StateBlock Q = block;
  long blocks = 0;
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
    MatrixXd grown = MatrixXd::Zero(Q.columns(), Q.columns());
    grown.topLeftCorner(H.rows(), H.cols()) = H;
    grown.rightCols(block.columns()) = along;
    block = orthonormal(flow, image, 1e-8);
    const MatrixXd remainder = inner_products(block, energy_images(flow, image));
    H = std::move(grown);
    bound_ritz(Q, H, remainder, search);
    const bool converged = search.residual < ritz_settled;
    if (++blocks >= least_blocks && (search.bounded || converged)) return search;
    if (block.columns() == 0) return search;
    // the next block's columns see what this one adds to them
    H.conservativeResizeLike(MatrixXd::Zero(H.rows() + remainder.rows(), H.cols()));
    H.bottomRightCorner(remainder.rows(), remainder.cols()) = remainder;
    append(Q, block);
  }
  return search;
}

} // namespace squeal
