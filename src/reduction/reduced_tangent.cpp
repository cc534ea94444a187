/// The reduced period map's derivative (src/README.md, sections 4.13 and 7.5) along recorded contact. With x = (v, q),
/// db = b x the changes of the closed pairs' rows and dr = -A^-1 T db their reactions, a step is
///     v+ = F x + P dr,     q+ = q + h (theta v+ + (1-theta) v).
#include "squeal/reduction/reduced_tangent.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/error.hpp"
#include "squeal/contact/sliding_direction.hpp"

#include <algorithm>
#include <Eigen/LU>
#include <Eigen/QR>
#include <ranges>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<Index> rows_of(const std::vector<std::size_t>& pairs, int directions)
{
  const PairRows<Index> rows(directions);
  std::vector<Index> result;
  for (const std::size_t pair : pairs)
    for (Index k = 0; k < rows.per_pair(); ++k) result.push_back(rows.normal(static_cast<Index>(pair)) + k);
  return result;
}

/// The pair's part of T: damping of the friction that slides, symmetric.
struct Turn
{
  Index tangential = 0; // the pair's first tangential row among those of the closed pairs
  MatrixXd damping;     // [N s/m]
};

/// The contact of one step, linearised.
struct LinearStep
{
  std::vector<Index> rows; // of the closed pairs
  MatrixXd rates;          // b
  std::vector<Turn> turns; // T is the identity but there
  MatrixXd A{};            // P A = L U once it is factored
  Eigen::VectorXi order{}; // P
};

void factor(LinearStep& step)
{
  step.order = Eigen::VectorXi::LinSpaced(step.A.rows(), 0, to_int(step.A.rows()) - 1);
  if (step.rows.empty() || !step.A.allFinite()) return; // LAPACK would leave the order unset
  const Eigen::PartialPivLU<Eigen::Ref<MatrixXd>> in_place(step.A);
  step.order = in_place.permutationP().indices();
}

/// Gives every rank the factor that `root` has.
void share_factor(LinearStep& step, int root, MPI_Comm comm)
{
  if (ranks_of(comm) == 1) return;
  step.order.resize(step.A.rows());
  MPI_Bcast(step.A.data(), to_int(step.A.size()), MPI_DOUBLE, root, comm);
  MPI_Bcast(step.order.data(), to_int(step.order.size()), MPI_INT, root, comm);
}

/// A^-1 x.
MatrixXd solve(const LinearStep& step, const MatrixXd& x)
{
  MatrixXd result = Eigen::PermutationMatrix<Eigen::Dynamic>(step.order) * x;
  step.A.triangularView<Eigen::UnitLower>().solveInPlace(result);
  step.A.triangularView<Eigen::Upper>().solveInPlace(result);
  return result;
}

/// A'^-1 x.
MatrixXd solve_transposed(const LinearStep& step, MatrixXd x)
{
  step.A.triangularView<Eigen::Upper>().transpose().solveInPlace(x);
  step.A.triangularView<Eigen::UnitLower>().transpose().solveInPlace(x);
  return Eigen::PermutationMatrix<Eigen::Dynamic>(step.order).transpose() * x;
}

void turn(const LinearStep& step, MatrixXd& x)
{
  for (const Turn& pair : step.turns)
  {
    const Index d = pair.damping.rows();
    x.middleRows(pair.tangential, d) = (pair.damping * x.middleRows(pair.tangential, d)).eval();
  }
}

/// A of the closed pairs at w and r of the step, not yet factored: friction that slides follows the normal reactions
/// and turns.
void linearise_contact(const ReducedMap& map, const RecordedContact& contact, const std::vector<std::size_t>& closed,
                       LinearStep& step)
{
  const ReducedModel& model = map.model;
  const Index d = model.directions;
  const PairRows<Index> rows(model.directions);
  const PairView<const double> r(contact.r, model.directions), w(contact.w, model.directions);
  const std::vector<ContactStatus> status = contact_status(r, w, model.friction);
  const PairFriction laws = law_of_step(model.friction, map.theta);
  MatrixXd A = map.W(step.rows, step.rows);
  for (std::size_t i = 0; i < closed.size(); ++i)
  {
    const std::span<const double> s = w.tangential(closed[i]);
    if (status[closed[i]] == ContactStatus::stick || length(s) == 0) continue;
    const SlidingFriction friction = sliding_friction(laws.of(closed[i]), r.normal(closed[i]), s);
    const Index normal = rows.normal(static_cast<Index>(i)), tangential = rows.tangential(static_cast<Index>(i));
    MatrixXd damping(d, d);
    for (Index k = 0; k < d; ++k)
      for (Index l = 0; l < d; ++l)
        damping(k, l) = friction.damping[static_cast<std::size_t>(k)][static_cast<std::size_t>(l)];
    A.middleRows(tangential, d) = (damping * A.middleRows(tangential, d)).eval();
    A.block(tangential, tangential, d, d) += MatrixXd::Identity(d, d);
    A.block(tangential, normal, d, 1) += VectorXd::Map(friction.along.data(), d);
    step.turns.push_back({tangential, std::move(damping)});
  }
  for (Index i = 0; i < A.rows(); ++i) // of pairs that stick there may be more rows than the shapes can tell apart
    A(i, i) = A.row(i).isZero(0) ? 1 : A(i, i) * (1 + 1e-10);
  step.A = std::move(A);
}

/// db of all rows for changes of the start (v, q), without past sliding.
MatrixXd free_rates(const ReducedMap& map)
{
  const ReducedModel& model = map.model;
  const Index n = model.size();
  const PairRows<Index> rows(model.directions);
  MatrixXd rates(model.G.rows(), 2 * n);
  const Share own = share_of(2 * n, map.comm);
  rates.middleCols(own.first, own.count).noalias() = model.G * map.from_state.middleCols(own.first, own.count);
  gather_columns(rates, map.comm);
  for (Index pair = 0; pair < static_cast<Index>(model.active.size()); ++pair)
  {
    const auto normal = model.G.row(rows.normal(pair));
    const CompliantGap law = gap_law(map, static_cast<std::size_t>(pair));
    rates.row(rows.normal(pair)).head(n) += law.by_rate * normal;
    rates.row(rows.normal(pair)).tail(n) += law.by_gap * normal;
  }
  return rates;
}

LinearStep linear_step(const ReducedMap& map, const MatrixXd& rates_of_all, const RecordedContact& contact)
{
  const ReducedModel& model = map.model;
  const Index n = model.size(), d = model.directions;
  const PairRows<Index> rows(model.directions);
  const PairView<const double> r(contact.r, model.directions);
  std::vector<std::size_t> closed;
  for (std::size_t pair = 0; pair < r.pairs(); ++pair)
    if (r.normal(pair) > 0) closed.push_back(pair);
  LinearStep step{rows_of(closed, model.directions), {}, {}};
  if (closed.empty()) return step;
  step.rates = rates_of_all(step.rows, Eigen::all);
  for (std::size_t i = 0; i < closed.size(); ++i)
    if (contact.opposes_theta[closed[i]])
      step.rates.middleRows(rows.tangential(static_cast<Index>(i)), d).leftCols(n) +=
          (1 - map.theta) / map.theta * model.G.middleRows(rows.tangential(static_cast<Index>(closed[i])), d);
  linearise_contact(map, contact, closed, step);
  return step;
}

/// Columns of the start, rows (v, q), to those of the step's end.
void advance_columns(const ReducedMap& map, const LinearStep& step, MatrixXd& X)
{
  const Index n = map.model.size();
  MatrixXd v = map.from_state * X;
  if (!step.rows.empty())
  {
    MatrixXd db = step.rates * X;
    turn(step, db);
    v.noalias() -= map.from_reactions(Eigen::all, step.rows) * solve(step, db);
  }
  X.bottomRows(n) += map.h * (map.theta * v + (1 - map.theta) * X.topRows(n));
  X.topRows(n) = v;
}

/// Columns of the step's end to those of its start, by the transpose.
void go_back(const ReducedMap& map, const LinearStep& step, MatrixXd& X)
{
  const Index n = map.model.size();
  const MatrixXd v = X.topRows(n) + map.h * map.theta * X.bottomRows(n); // on v+
  MatrixXd start = map.from_state.transpose() * v;
  start.topRows(n) += map.h * (1 - map.theta) * X.bottomRows(n);
  start.bottomRows(n) += X.bottomRows(n);
  if (!step.rows.empty())
  {
    MatrixXd y = solve_transposed(step, map.from_reactions(Eigen::all, step.rows).transpose() * v);
    turn(step, y);
    start.noalias() -= step.rates.transpose() * y;
  }
  X = std::move(start);
}

/// Rows (v, q) for (q, v), and back.
MatrixXd halves_exchanged(const MatrixXd& X)
{
  const Index n = X.rows() / 2;
  MatrixXd result(X.rows(), X.cols());
  result << X.bottomRows(n), X.topRows(n);
  return result;
}

/// The columns (q, v) after a passage(step, X) of each contact, X with rows (v, q): this rank's share of the columns.
/// Each rank factors its share of the steps.
template <class Contacts, class Passage> MatrixXd
through_period(ReducedMap& map, double period, const Contacts& contacts, const MatrixXd& columns, Passage passage)
{
  prepare(map, period);
  const MatrixXd rates = free_rates(map);
  const Share own = share_of(columns.cols(), map.comm);
  MatrixXd X = halves_exchanged(columns.middleCols(own.first, own.count));
  const auto rank = static_cast<std::size_t>(rank_of(map.comm)), ranks = static_cast<std::size_t>(ranks_of(map.comm));
  const auto step_at = [&](std::size_t i) { return linear_step(map, rates, contacts[static_cast<std::ptrdiff_t>(i)]); };
  LinearStep factored;
  for (std::size_t i = 0; i < contacts.size(); ++i)
  {
    if (i % ranks == 0 && i + rank < contacts.size()) factor(factored = step_at(i + rank));
    LinearStep step = i % ranks == rank ? std::move(factored) : step_at(i);
    share_factor(step, static_cast<int>(i % ranks), map.comm);
    passage(step, X);
  }
  MatrixXd result(columns.rows(), columns.cols());
  result.middleCols(own.first, own.count) = halves_exchanged(X);
  gather_columns(result, map.comm);
  return result;
}

/// Tangential rows of the undriven pairs that stick in every step.
std::vector<Index> rows_held(const ReducedModel& model, std::span<const RecordedContact> contacts)
{
  const int directions = model.directions;
  std::vector<char> held(directions > 0 ? model.active.size() : 0);
  for (std::size_t i = 0; i < held.size(); ++i) held[i] = length(TangentView(model.drive, directions).of(i)) == 0;
  if (std::ranges::count(held, 1) == 0) return {};
  for (const RecordedContact& contact : contacts)
  {
    const std::vector<ContactStatus> status = contact_status(
        PairView<const double>(contact.r, directions), PairView<const double>(contact.w, directions), model.friction);
    for (std::size_t i = 0; i < held.size(); ++i) held[i] = held[i] && status[i] == ContactStatus::stick;
  }
  std::vector<Index> rows;
  for (std::size_t i = 0; i < held.size(); ++i)
    for (Index k = 0; held[i] && k < directions; ++k)
      rows.push_back(PairRows<Index>(directions).tangential(static_cast<Index>(i)) + k);
  return rows;
}

} // namespace

std::vector<RecordedContact> record_contacts(ReducedMap& map, double period, ReducedState state)
{
  prepare(map, period);
  share_state(state, map.comm);
  std::vector<RecordedContact> contacts;
  ReducedContact contact{map.reactions};
  for (int i = 0; i < map.steps; ++i)
  {
    if (!advance(map, state, contact)) ++map.unconverged;
    RecordedContact& now = contacts.emplace_back(RecordedContact{contact.r, contact.w, {}});
    broadcast(now.r, map.comm); // ranks that see other pairs closed would factor other matrices
    broadcast(now.w, map.comm);
    for (std::size_t pair = 0; pair < map.model.active.size(); ++pair)
      now.opposes_theta.push_back(!opposes_end(PairView<const double>(contact.past, map.model.directions), pair));
    MPI_Bcast(now.opposes_theta.data(), to_int(now.opposes_theta.size()), MPI_CHAR, 0, map.comm);
  }
  return contacts;
}

std::vector<RecordedContact> recorded_contacts(const ReducedModel& model, int directions,
                                               std::span<const StepRecord> records)
{
  std::vector<RecordedContact> contacts;
  const auto rows = PairRows<Index>(model.directions).rows_of(static_cast<Index>(model.active.size()));
  for (const StepRecord& record : records)
  {
    RecordedContact& contact = contacts.emplace_back(RecordedContact{VectorXd(rows), VectorXd(rows), {}});
    const PairView<double> r(contact.r, model.directions), w(contact.w, model.directions);
    for (std::size_t i = 0; i < model.active.size(); ++i)
    {
      const auto pair = static_cast<std::size_t>(model.active[i]);
      r.set(i, PairView(record.reactions, directions).vector(pair));
      w.set(i, PairView(record.contact_velocity, directions).vector(pair));
      contact.opposes_theta.push_back(record.opposes_theta[pair]);
    }
  }
  return contacts;
}

MatrixXd apply_tangent(ReducedMap& map, double period, std::span<const RecordedContact> contacts,
                       const MatrixXd& columns)
{
  return through_period(map, period, contacts, columns,
                        [&](const LinearStep& step, MatrixXd& X) { advance_columns(map, step, X); });
}

MatrixXd apply_adjoint(ReducedMap& map, double period, std::span<const RecordedContact> contacts,
                       const MatrixXd& columns)
{
  return through_period(map, period, contacts | std::views::reverse, columns,
                        [&](const LinearStep& step, MatrixXd& X) { go_back(map, step, X); });
}

MatrixXd monodromy(ReducedMap& map, double period, std::span<const RecordedContact> contacts)
{
  const Index n = map.model.size(), slow = map.model.slow;
  MatrixXd columns = MatrixXd::Zero(2 * n, 2 * slow);
  columns.topLeftCorner(slow, slow).diagonal().setOnes();
  columns.block(n, slow, slow, slow).diagonal().setOnes();
  const MatrixXd held = map.model.G(rows_held(map.model, contacts), Eigen::all);
  if (held.rows() > 0) // each row has a multiplier 1: columns begin with none of it
  {
    const Eigen::CompleteOrthogonalDecomposition<MatrixXd> rows(held);
    columns.topLeftCorner(n, slow) -= rows.solve(held.leftCols(slow));
    columns.bottomRightCorner(n, slow) = columns.topLeftCorner(n, slow);
  }
  return apply_tangent(map, period, contacts, columns);
}

} // namespace squeal
