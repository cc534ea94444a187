/// The contact of the reduced model's active pairs as the eliminated ones let them move.
///
/// W is slightly unsymmetric (friction of the eliminated pairs) and far from local (a few shapes carry far), so the
/// solvers of contact/solver.hpp do not fit. Block Gauss-Seidel solves the pairs one by one; w follows each change.
#include "squeal/reduction/reduced_step.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/contact/interface.hpp"
#include "squeal/contact/pair_law.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

struct Iterate
{
  const ReducedMap& map;
  VectorXd& r;
  VectorXd& w;  // W r + b
  double speed; // [m/s] the largest of b
  PairFriction friction;
  int directions = map.model.directions;
  PairRows<Index> rows{directions};

  std::size_t pairs() const { return map.own.size(); }
  PairVector reaction(std::size_t pair) const { return PairView<const double>(r, directions).vector(pair); }
  PairVector velocity(std::size_t pair) const { return PairView<const double>(w, directions).vector(pair); }

  /// The natural map over the pair's force scale.
  double defect(std::size_t pair, double largest) const
  {
    const NaturalScale rho = natural_scale(map.own[pair], 0);
    const double error = natural_map(reaction(pair), velocity(pair), friction.of(pair), rho);
    return error > 0 ? error / force_scale(rho, speed, largest) : 0;
  }
};

/// The pair's reaction becomes `next`, and w follows.
void change_reaction(Iterate& iterate, std::size_t pair, const PairVector& next)
{
  const PairVector last = iterate.reaction(pair);
  for (Index k = 0; k < iterate.rows.per_pair(); ++k)
    if (const double change = next[static_cast<std::size_t>(k)] - last[static_cast<std::size_t>(k)]; change != 0)
      iterate.w += change * iterate.map.W.col(iterate.rows.normal(static_cast<Index>(pair)) + k);
  PairView<double>(iterate.r, iterate.directions).set(pair, next);
}

/// A warm start need not be admissible.
void admit(Iterate& iterate)
{
  for (std::size_t pair = 0; pair < iterate.pairs(); ++pair)
    change_reaction(iterate, pair,
                    first_reaction(iterate.map.own[pair], iterate.reaction(pair), iterate.velocity(pair),
                                   iterate.directions, iterate.friction.of(pair)));
}

/// One sweep over the pairs whose defect exceeds `limit`, each solved whole. The local solves see the symmetric part
/// of W's own blocks, which leaves the fixed point what it is.
void sweep_pairs(Iterate& iterate, double limit)
{
  const double largest = iterate.r.cwiseAbs().maxCoeff();
  for (std::size_t pair = 0; pair < iterate.pairs(); ++pair)
  {
    if (iterate.defect(pair, largest) <= limit) continue;
    const PairBlock& A = iterate.map.own[pair];
    const PairVector last = iterate.reaction(pair), q = velocity_without(A, last, iterate.velocity(pair));
    change_reaction(iterate, pair, solve_pair(A, q, iterate.directions, iterate.friction.of(pair), last));
  }
}

double largest_defect(const Iterate& iterate)
{
  const double largest = iterate.r.cwiseAbs().maxCoeff();
  double worst = 0;
  for (std::size_t pair = 0; pair < iterate.pairs(); ++pair) worst = std::max(worst, iterate.defect(pair, largest));
  return worst;
}

} // namespace

bool solve_contact(const ReducedMap& map, const VectorXd& b, ReducedContact& contact)
{
  if (b.size() == 0) return true;
  const bool alone = contact.r_before.size() == 0;
  const auto extrapolate = [alone](VectorXd& now, VectorXd& before)
  {
    const VectorXd next = alone ? now : VectorXd(2 * now - before);
    before = std::exchange(now, next);
  };
  extrapolate(contact.r, contact.r_before);
  extrapolate(contact.Wr, contact.Wr_before);
  contact.w = b + contact.Wr;
  const PairView<const double> past(contact.past, map.model.directions);
  Iterate iterate{map, contact.r, contact.w, b.cwiseAbs().maxCoeff(),
                  law_of_step(sliding_on(contact.friction, past), map.theta)};
  admit(iterate);
  const double tolerance = map.contact.tolerance;
  double worst = largest_defect(iterate);
  for (int sweep = 0; worst > tolerance && sweep < map.contact.max_iterations; ++sweep)
  {
    sweep_pairs(iterate, 0.01 * tolerance);
    worst = largest_defect(iterate);
  }
  contact.Wr = contact.w - b;
  return worst <= tolerance;
}

// The modified theta-method on the reduced model: the scheme of transient/theta_step.hpp, in few dense products.

namespace
{

/// The symmetric part of each pair's own block of W.
std::vector<PairBlock> own_blocks(const MatrixXd& W, const ReducedModel& model)
{
  const PairRows<Eigen::Index> rows(model.directions);
  std::vector<PairBlock> result(model.active.size(), PairBlock{});
  for (std::size_t pair = 0; pair < result.size(); ++pair)
  {
    const Eigen::Index first = rows.normal(static_cast<Eigen::Index>(pair));
    for (Eigen::Index k = 0; k < rows.per_pair(); ++k)
      for (Eigen::Index l = 0; l < rows.per_pair(); ++l)
        result[pair][static_cast<std::size_t>(k)][static_cast<std::size_t>(l)] =
            (W(first + k, first + l) + W(first + l, first + k)) / 2;
  }
  return result;
}

/// This rank's share of the columns.
auto columns_of_rank(MatrixXd& A, MPI_Comm comm)
{
  const Share share = share_of(A.cols(), comm);
  return A.middleCols(share.first, share.count);
}

} // namespace

CompliantGap gap_law(const ReducedMap& map, std::size_t pair)
{
  const double c = map.model.compliance[pair];
  return c > 0 ? compliant_gap(c, map.theta, map.h) : CompliantGap{1 / map.h, 1 - map.theta, 0};
}

void share_state(ReducedState& state, MPI_Comm comm)
{
  broadcast(state.q, comm);
  broadcast(state.v, comm);
}

void prepare(ReducedMap& map, double period)
{
  MPI_Bcast(&period, 1, MPI_DOUBLE, 0, map.comm); // another one would make other ranks wait
  const double h = period / map.steps;
  if (h == map.h) return;
  const ReducedModel& model = map.model;
  const double theta = map.theta;
  const Eigen::Index n = model.size(), rows = model.G.rows();
  MatrixXd right(n, 2 * n + rows + 1);
  right << model.M - h * (1 - theta) * model.C - h * h * theta * (1 - theta) * model.K, -h * model.K, h * model.H,
      h * model.force;
  solve_dense_in_place(model.M + h * theta * model.C + h * h * theta * theta * model.K,
                       columns_of_rank(right, map.comm), "reduced model: a motion has neither mass nor stiffness");
  gather_columns(right, map.comm);
  map.h = h;
  map.from_state = right.leftCols(2 * n);
  map.from_reactions = right.middleCols(2 * n, rows);
  map.from_load = right.col(2 * n + rows);
  map.W.resize(rows, rows);
  columns_of_rank(map.W, map.comm).noalias() = model.G * columns_of_rank(map.from_reactions, map.comm);
  gather_columns(map.W, map.comm);
  const PairRows<Eigen::Index> pairs(model.directions);
  for (std::size_t i = 0; i < model.active.size(); ++i)
  {
    const Eigen::Index normal = pairs.normal(static_cast<Eigen::Index>(i));
    map.W(normal, normal) += gap_law(map, i).by_reaction;
  }
  map.own = own_blocks(map.W, model);
}

namespace
{

/// b of w = W r + b without past sliding, from b = G v_free. Normal rows are gap rates (g0 + G_n q~)/h + G_n v_free, q~
/// = q + h (1-theta) v; tangential ones are sliding velocities.
VectorXd free_contact_velocity(const ReducedMap& map, const ReducedContact& contact, VectorXd b)
{
  const ReducedModel& model = map.model;
  const PairView<double> velocity(b, model.directions);
  const PairView before(contact.velocity, model.directions), position(contact.position, model.directions);
  const TangentView drive(model.drive, model.directions);
  for (std::size_t i = 0; i < model.gap.size(); ++i)
  {
    const double gap = model.gap[i] + position.normal(i);
    const CompliantGap law = gap_law(map, i);
    velocity.normal(i) += law.by_gap * gap + law.by_rate * before.normal(i);
    for (std::size_t k = 0; k < drive.of(i).size(); ++k) velocity.tangential(i)[k] -= drive.of(i)[k];
  }
  return b;
}

/// G v - v_d, whose normal rows are of no use.
VectorXd contact_velocity(const ReducedModel& model, VectorXd velocity)
{
  const PairView<double> result(velocity, model.directions);
  const TangentView drive(model.drive, model.directions);
  for (std::size_t i = 0; i < result.pairs(); ++i)
    for (std::size_t k = 0; k < drive.of(i).size(); ++k) result.tangential(i)[k] -= drive.of(i)[k];
  return velocity;
}

/// Solves contact, again as long as a pair is turned by its past sliding. Returns whether it converged.
bool find_reactions(const ReducedMap& map, const VectorXd& Gv_free, ReducedContact& contact)
{
  const ReducedModel& model = map.model;
  const VectorXd free = free_contact_velocity(map, contact, Gv_free);
  const auto reactions = [&] { return PairView<const double>(contact.r, model.directions); };
  contact.friction =
      at_release(model.friction, reactions(), PairView<const double>(contact.r_before, model.directions));
  const VectorXd sliding = contact_velocity(model, contact.velocity);
  contact.past =
      past_sliding(PairView(contact.velocity, model.directions), TangentView(model.drive, model.directions),
                   contact_status(reactions(), PairView<const double>(sliding, model.directions), model.friction),
                   (1 - map.theta) / map.theta);
  const auto b = [&] { return VectorXd(free + VectorXd::Map(contact.past.data(), free.size())); };
  bool converged = solve_contact(map, b(), contact);
  while (leave_out_where_turned(reactions(), PairView<const double>(contact.w, model.directions),
                                PairView(contact.past, model.directions)))
  {
    contact.r_before.resize(0); // no step is between
    converged = solve_contact(map, b(), contact);
  }
  return converged;
}

/// G v+ of G v_free: W r is at hand, of which a pair's own compliance is no motion.
VectorXd moved_by_reactions(const ReducedMap& map, const ReducedContact& contact, VectorXd velocity)
{
  velocity += contact.Wr;
  const PairView<double> result(velocity, map.model.directions);
  const PairView r(contact.r, map.model.directions);
  for (std::size_t i = 0; i < map.model.gap.size(); ++i) result.normal(i) -= gap_law(map, i).by_reaction * r.normal(i);
  return velocity;
}

} // namespace

bool advance(const ReducedMap& map, ReducedState& state, ReducedContact& contact)
{
  const Eigen::Index n = map.model.size();
  const MatrixXd& G = map.model.G;
  if (contact.Wr.size() == 0)
  {
    contact.Wr = map.W * contact.r;
    contact.position = G * state.q;
    contact.velocity = G * state.v;
  }
  VectorXd both(2 * n);
  both << state.v, state.q;
  VectorXd next = map.from_state * both + map.from_load;
  const VectorXd Gv_free = G * next;
  const bool converged = find_reactions(map, Gv_free, contact);
  next.noalias() += map.from_reactions * contact.r;
  const auto move = [&](VectorXd& position, VectorXd& velocity, VectorXd end)
  {
    position += map.h * (map.theta * end + (1 - map.theta) * velocity);
    velocity = std::move(end);
  };
  move(contact.position, contact.velocity, moved_by_reactions(map, contact, Gv_free));
  move(state.q, state.v, std::move(next));
  return converged;
}

namespace
{

/// The one loop over time of the reduced model: N steps from `state` on.
void march(ReducedMap& map, ReducedState& state, ReducedContact& contact,
           const std::function<void(const ReducedState&)>& watch)
{
  for (int i = 0; i < map.steps; ++i)
  {
    if (!advance(map, state, contact)) ++map.unconverged;
    if (watch) watch(state);
  }
}

} // namespace

ReducedState integrate(ReducedMap& map, double period, ReducedState state,
                       const std::function<void(const ReducedState&)>& watch)
{
  prepare(map, period);
  share_state(state, map.comm);
  ReducedContact contact{map.reactions};
  march(map, state, contact, watch);
  return state;
}

std::vector<StepRecord> record_contacts(ReducedMap& map, double period, ReducedState state)
{
  prepare(map, period);
  share_state(state, map.comm);
  std::vector<StepRecord> records;
  ReducedContact contact{map.reactions};
  const auto add = [&](const ReducedState&)
  {
    StepRecord& record = records.emplace_back();
    record.reactions.assign(contact.r.begin(), contact.r.end());
    record.contact_velocity.assign(contact.w.begin(), contact.w.end());
    for (std::size_t pair = 0; pair < map.model.active.size(); ++pair)
      record.opposes_theta.push_back(!opposes_end(PairView<const double>(contact.past, map.model.directions), pair));
  };
  march(map, state, contact, add);
  return records;
}

PeriodEnd end_of_period(ReducedMap& map, double period, ReducedState state)
{
  prepare(map, period);
  share_state(state, map.comm);
  ReducedContact contact{map.reactions};
  ReducedState last_but_one;
  int done = 0;
  march(map, state, contact,
        [&](const ReducedState& now)
        {
          if (++done == map.steps - 1) last_but_one = now;
        });
  PeriodEnd result{state, {}};
  (void)advance(map, state, contact);
  result.rate = {(state.q - last_but_one.q) / (2 * map.h), (state.v - last_but_one.v) / (2 * map.h)};
  for (ReducedState* shared : {&result.end, &result.rate}) share_state(*shared, map.comm);
  return result;
}

} // namespace squeal
