/// The reduced period map's derivative.
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/contact/sliding_direction.hpp"
#include "squeal/reduction/reduced_model.hpp"

namespace squeal
{

namespace
{

using Eigen::MatrixXd;
using Eigen::VectorXd;

using Eigen::Index;

/// Pairs that touch at the end of a step.
std::vector<std::size_t> closed_pairs(const ReducedContact& contact, int directions)
{
  const PairView<const double> r(contact.r, directions);
  std::vector<std::size_t> closed;
  for (std::size_t pair = 0; pair < r.pairs(); ++pair)
    if (r.normal(pair) > 0) closed.push_back(pair);
  return closed;
}

std::vector<Index> rows_of(const std::vector<std::size_t>& pairs, int directions)
{
  const PairRows<Index> rows(directions);
  std::vector<Index> result;
  for (const std::size_t pair : pairs)
    for (Index k = 0; k < rows.per_pair(); ++k) result.push_back(rows.normal(static_cast<Index>(pair)) + k);
  return result;
}

/// dr of w = W r + b in the rows of the closed pairs for changes db of these, under the contact law where it is smooth:
/// at w and r of the step just made (src/README.md, section 4.13).
MatrixXd contact_response(const ReducedMap& map, const ReducedContact& contact, const std::vector<std::size_t>& closed,
                          const MatrixXd& db)
{
  const ReducedModel& model = map.model;
  const Index d = model.directions;
  const PairRows<Index> rows(model.directions);
  const PairView<const double> r(contact.r, model.directions), w(contact.w, model.directions);
  const std::vector<ContactStatus> status = contact_status(r, model.friction);
  const std::vector<Index> all = rows_of(closed, model.directions);
  MatrixXd A = map.W(all, all), right = -db;
  for (std::size_t i = 0; i < closed.size(); ++i)
  {
    const std::span<const double> s = w.tangential(closed[i]);
    if (status[closed[i]] == ContactStatus::stick || length(s) == 0) continue;
    const SlidingFriction friction = sliding_friction(model.friction, r.normal(closed[i]), s);
    const Index normal = rows.normal(static_cast<Index>(i)), tangential = rows.tangential(static_cast<Index>(i));
    MatrixXd damping(d, d);
    for (Index k = 0; k < d; ++k)
      for (Index l = 0; l < d; ++l)
        damping(k, l) = friction.damping[static_cast<std::size_t>(k)][static_cast<std::size_t>(l)];
    A.middleRows(tangential, d) = (damping * A.middleRows(tangential, d)).eval();
    right.middleRows(tangential, d) = (damping * right.middleRows(tangential, d)).eval();
    A.block(tangential, tangential, d, d) += MatrixXd::Identity(d, d);
    A.block(tangential, normal, d, 1) += VectorXd::Map(friction.along.data(), d);
  }
  A.diagonal() *= 1 + 1e-10; // of pairs that stick there may be more rows than the shapes can tell apart
  return solve_dense(std::move(A), right, "reduced model: the contact of a step determines no reactions");
}

/// db of all rows for changes of the start (v, q), without past sliding.
MatrixXd free_rates(const ReducedMap& map)
{
  const ReducedModel& model = map.model;
  const Index n = model.size();
  const PairRows<Index> rows(model.directions);
  MatrixXd rates = model.G * map.from_state;
  for (Index pair = 0; pair < static_cast<Index>(model.active.size()); ++pair)
  {
    const auto normal = model.G.row(rows.normal(pair));
    rates.row(rows.normal(pair)).head(n) += (1 - map.theta) * normal;
    rates.row(rows.normal(pair)).tail(n) += normal / map.h;
  }
  return rates;
}

/// db of the closed pairs' rows for changes of the start (v, q): of those of all rows, with past sliding.
MatrixXd closed_rates(const ReducedMap& map, const MatrixXd& rates_of_all, const ReducedContact& contact,
                      const std::vector<std::size_t>& closed)
{
  const ReducedModel& model = map.model;
  const Index n = model.size(), d = model.directions;
  const PairRows<Index> all(model.directions);
  MatrixXd rates = rates_of_all(rows_of(closed, model.directions), Eigen::all);
  for (std::size_t i = 0; i < closed.size(); ++i)
    if (!opposes_end(PairView<const double>(contact.past, model.directions), closed[i]))
      rates.middleRows(all.tangential(static_cast<Index>(i)), d).leftCols(n) +=
          (1 - map.theta) / map.theta * model.G.middleRows(all.tangential(static_cast<Index>(closed[i])), d);
  return rates;
}

} // namespace

MatrixXd monodromy(ReducedMap& map, double period, ReducedState state, Eigen::Index slow, MPI_Comm comm)
{
  prepare(map, period);
  const ReducedModel& model = map.model;
  const double h = map.h, theta = map.theta;
  const Index n = model.size();
  const MatrixXd rates = free_rates(map);
  // this rank's columns, of (q, v); the rows are (v, q), as in the step
  const Index first = 2 * slow * rank_of(comm) / ranks_of(comm), last = 2 * slow * (rank_of(comm) + 1) / ranks_of(comm);
  MatrixXd X = MatrixXd::Zero(2 * n, last - first);
  for (Index column = first; column < last; ++column) X(column < slow ? n + column : column - slow, column - first) = 1;
  ReducedContact contact{map.reactions};
  for (int i = 0; i < map.steps; ++i)
  {
    if (!advance(map, state, contact)) ++map.unconverged;
    MatrixXd v = map.from_state * X;
    if (const auto closed = closed_pairs(contact, model.directions); !closed.empty())
    {
      const MatrixXd db = closed_rates(map, rates, contact, closed) * X;
      const std::vector<Index> rows = rows_of(closed, model.directions);
      v += map.from_reactions(Eigen::all, rows) * contact_response(map, contact, closed, db);
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
