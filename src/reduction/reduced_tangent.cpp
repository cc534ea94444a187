/// The reduced period map's derivative (src/README.md, sections 4.13 and 7.5) along recorded contact. With x = (v, q),
/// b x the changes of the rows of contact and dr = Q y their reactions (transient/linear_contact.hpp), a step is
///     v+ = F x + P Q y,     q+ = q + h (theta v+ + (1-theta) v).
#include "squeal/reduction/reduced_step.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/error.hpp"
#include "squeal/contact/interface.hpp"
#include "squeal/transient/linear_contact.hpp"

#include <algorithm>
#include <Eigen/QR>
#include <ranges>

namespace squeal
{

namespace
{

/// The contact of one step, linearised.
struct LinearStep
{
  LinearContact contact;
  MatrixXd rates;        // b
  MatrixXd by_reactions; // P Q
};

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

LinearStep linear_step(const ReducedMap& map, const MatrixXd& rates, const StepRecord& record)
{
  const ReducedModel& model = map.model;
  const Index n = model.size(), d = model.directions;
  const PairRows<Index> rows(model.directions);
  LinearContact contact(map.W, {model.directions, model.friction, map.theta}, record);
  if (contact.is_open()) return {std::move(contact), {}, {}};
  MatrixXd of_rows = contact.rows_of(rates), by_reactions = contact.columns_of(map.from_reactions);
  if (d > 0)
  {
    MatrixXd past = MatrixXd::Zero(rates.rows(), n);
    for (std::size_t i = 0; i < record.opposes_theta.size(); ++i)
      if (const Index first = rows.tangential(static_cast<Index>(i)); record.opposes_theta[i])
        past.middleRows(first, d) = (1 - map.theta) / map.theta * model.G.middleRows(first, d);
    of_rows.leftCols(n) += contact.rows_of(past);
  }
  return {std::move(contact), std::move(of_rows), std::move(by_reactions)};
}

/// Columns of the start, rows (v, q), to those of the step's end.
void advance_columns(const ReducedMap& map, const LinearStep& step, MatrixXd& X)
{
  const Index n = map.model.size();
  MatrixXd v = map.from_state * X;
  if (!step.contact.is_open()) v.noalias() += step.by_reactions * step.contact.solve(step.rates * X);
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
  if (!step.contact.is_open())
    start.noalias() += step.rates.transpose() * step.contact.solve_transposed(step.by_reactions.transpose() * v);
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
template <class Contacts, class Passage> MatrixXd
through_period(ReducedMap& map, double period, const Contacts& contacts, const MatrixXd& columns, Passage passage)
{
  prepare(map, period);
  const MatrixXd rates = free_rates(map);
  const Share own = share_of(columns.cols(), map.comm);
  MatrixXd X = halves_exchanged(columns.middleCols(own.first, own.count));
  for (const StepRecord& record : contacts) passage(linear_step(map, rates, record), X);
  MatrixXd result(columns.rows(), columns.cols());
  result.middleCols(own.first, own.count) = halves_exchanged(X);
  gather_columns(result, map.comm);
  return result;
}

/// Tangential rows of the undriven pairs that stick in every step.
std::vector<Index> rows_held(const ReducedModel& model, std::span<const StepRecord> contacts)
{
  const int directions = model.directions;
  std::vector<char> held(directions > 0 ? model.active.size() : 0);
  for (std::size_t i = 0; i < held.size(); ++i) held[i] = length(TangentView(model.drive, directions).of(i)) == 0;
  if (std::ranges::count(held, 1) == 0) return {};
  for (const StepRecord& record : contacts)
  {
    const std::vector<ContactStatus> status = contact_status(
        PairView(record.reactions, directions), PairView(record.contact_velocity, directions), model.friction);
    for (std::size_t i = 0; i < held.size(); ++i) held[i] = held[i] && status[i] == ContactStatus::stick;
  }
  std::vector<Index> rows;
  for (std::size_t i = 0; i < held.size(); ++i)
    for (Index k = 0; held[i] && k < directions; ++k)
      rows.push_back(PairRows<Index>(directions).tangential(static_cast<Index>(i)) + k);
  return rows;
}

} // namespace

std::vector<StepRecord> recorded_contacts(const ReducedModel& model, int directions,
                                          std::span<const StepRecord> records)
{
  std::vector<StepRecord> of_active(records.size());
  const auto rows = PairRows<std::size_t>(model.directions).rows_of(model.active.size());
  for (std::size_t k = 0; k < records.size(); ++k)
  {
    StepRecord& own = of_active[k];
    own.reactions.resize(rows);
    own.contact_velocity.resize(rows);
    const PairView<double> r(own.reactions, model.directions), w(own.contact_velocity, model.directions);
    for (std::size_t i = 0; i < model.active.size(); ++i)
    {
      const auto pair = static_cast<std::size_t>(model.active[i]);
      r.set(i, PairView(records[k].reactions, directions).vector(pair));
      w.set(i, PairView(records[k].contact_velocity, directions).vector(pair));
      own.opposes_theta.push_back(records[k].opposes_theta[pair]);
    }
  }
  return of_active;
}

MatrixXd apply_tangent(ReducedMap& map, double period, std::span<const StepRecord> contacts, const MatrixXd& columns)
{
  return through_period(map, period, contacts, columns,
                        [&](const LinearStep& step, MatrixXd& X) { advance_columns(map, step, X); });
}

MatrixXd apply_adjoint(ReducedMap& map, double period, std::span<const StepRecord> contacts, const MatrixXd& columns)
{
  return through_period(map, period, contacts | std::views::reverse, columns,
                        [&](const LinearStep& step, MatrixXd& X) { go_back(map, step, X); });
}

MatrixXd monodromy(ReducedMap& map, double period, std::span<const StepRecord> contacts)
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
