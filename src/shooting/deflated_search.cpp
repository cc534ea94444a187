#include "deflated_search.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

constexpr Index block_size = 6;

/// The motions that are least in V, at most a block of them.
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

/// Bounds the largest Ritz pair of H. `remainder`: of the last block's image, whose columns are the last ones of H.
void bound_ritz(const MatrixXd& H, const MatrixXd& remainder, DeflatedSearch& search)
{
  const DenseEigenpair pair = solve_dense_unsymmetric(H).front();
  search.largest = pair.lambda;
  search.residual = (remainder * pair.y.tail(remainder.cols())).norm();
  search.bounded = std::abs(pair.lambda) + search.residual < 1;
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
    bound_ritz(H, remainder, search);
    if (search.bounded || block.columns() == 0) return search;
    // the next block's columns see what this one adds to them
    H.conservativeResizeLike(MatrixXd::Zero(H.rows() + remainder.rows(), H.cols()));
    H.bottomRightCorner(remainder.rows(), remainder.cols()) = remainder;
    append(Q, block);
  }
  return search;
}

} // namespace squeal
