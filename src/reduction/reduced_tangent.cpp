/// The reduced period map's derivative.
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/reduction/reduced_model.hpp"

namespace squeal
{

namespace
{

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Rows of the pairs that touch at the end of a step.
std::vector<Eigen::Index> closed_rows(const ReducedContact& contact, Eigen::Index block)
{
  std::vector<Eigen::Index> closed;
  for (Eigen::Index i = 0; i < contact.r.size(); i += block)
    for (Eigen::Index k = 0; k < block && contact.r(i) > 0; ++k) closed.push_back(i + k);
  return closed;
}

/// dr of w = W r + b in the closed rows for changes db of these, under the contact law where it is smooth: at w and r
/// of the step just made. Open pairs have none; of the others
///     dw_n = 0,   and dw_t = 0 (stick) or dr_t + mu e dr_n + mu r_n/|s| (I - e e') dw_t = 0, e = s/|s| (slip).
MatrixXd contact_response(const ReducedMap& map, const ReducedContact& contact, const std::vector<Eigen::Index>& closed,
                          const MatrixXd& db)
{
  const ReducedModel& model = map.model;
  const Eigen::Index d = model.directions, block = 1 + d;
  MatrixXd A = map.W(closed, closed), right = -db;
  for (Eigen::Index i = 0; i < A.rows(); i += block)
  {
    const Eigen::Index pair = closed[static_cast<std::size_t>(i)];
    const double limit = model.friction * contact.r(pair);
    if (sticks(contact.r.segment(pair, block), model.friction)) continue;
    const VectorXd s = contact.w.segment(pair + 1, d), e = s / std::max(s.norm(), 1e-300);
    const MatrixXd turn = limit / std::max(s.norm(), 1e-300) * (MatrixXd::Identity(d, d) - e * e.transpose());
    A.middleRows(i + 1, d) = (turn * A.middleRows(i + 1, d)).eval();
    right.middleRows(i + 1, d) = (turn * right.middleRows(i + 1, d)).eval();
    A.block(i + 1, i + 1, d, d) += MatrixXd::Identity(d, d);
    A.block(i + 1, i, d, 1) += model.friction * e;
  }
  A.diagonal() *= 1 + 1e-10; // of pairs that stick there may be more rows than the shapes can tell apart
  return solve_dense(std::move(A), right, "reduced model: the contact of a step determines no reactions");
}

} // namespace

MatrixXd monodromy(ReducedMap& map, double period, ReducedState state, Eigen::Index slow, MPI_Comm comm)
{
  prepare(map, period);
  const ReducedModel& model = map.model;
  const double h = map.h, theta = map.theta;
  const Eigen::Index n = model.size(), block = 1 + model.directions;
  MatrixXd b_from_state = model.G * map.from_state;
  for (Eigen::Index row = 0; row < model.G.rows(); row += block)
  {
    b_from_state.row(row).head(n) += (1 - theta) * model.G.row(row);
    b_from_state.row(row).tail(n) += model.G.row(row) / h;
  }
  // this rank's columns, of (q, v); the rows are (v, q), as in the step
  const Eigen::Index first = 2 * slow * rank_of(comm) / ranks_of(comm),
                     last = 2 * slow * (rank_of(comm) + 1) / ranks_of(comm);
  MatrixXd X = MatrixXd::Zero(2 * n, last - first);
  for (Eigen::Index column = first; column < last; ++column)
    X(column < slow ? n + column : column - slow, column - first) = 1;
  ReducedContact contact{map.reactions};
  for (int i = 0; i < map.steps; ++i)
  {
    if (!advance(map, state, contact)) ++map.unconverged;
    MatrixXd v = map.from_state * X;
    if (const auto closed = closed_rows(contact, block); !closed.empty())
    {
      MatrixXd rows = b_from_state(closed, Eigen::all);
      for (std::size_t k = 0; k < closed.size(); ++k)
        if (closed[k] % block > 0 && !contact.opposes_end[static_cast<std::size_t>(closed[k] / block)])
          rows.row(static_cast<Eigen::Index>(k)).head(n) += (1 - theta) / theta * model.G.row(closed[k]);
      v += map.from_reactions(Eigen::all, closed) * contact_response(map, contact, closed, rows * X);
    }
    X.bottomRows(n) += h * (theta * v + (1 - theta) * X.topRows(n));
    X.topRows(n) = v;
  }
  MatrixXd result = MatrixXd::Zero(2 * n, 2 * slow);
  result.topRows(n).middleCols(first, last - first) = X.bottomRows(n);
  result.bottomRows(n).middleCols(first, last - first) = X.topRows(n);
  // every entry is one rank's: a sum of it and zeros has the same bits everywhere
  MPI_Allreduce(MPI_IN_PLACE, result.data(), static_cast<int>(result.size()), MPI_DOUBLE, MPI_SUM, comm);
  return result;
}

} // namespace squeal
