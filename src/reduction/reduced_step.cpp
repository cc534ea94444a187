/// The modified theta-method on the reduced model: the scheme of transient/transient.hpp, in few dense products.
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/contact/pair_law.hpp"
#include "squeal/reduction/reduced_model.hpp"

namespace squeal
{

using Eigen::MatrixXd;
using Eigen::VectorXd;

void prepare(ReducedMap& map, double period)
{
  const double h = period / map.steps;
  if (h == map.h) return;
  const ReducedModel& model = map.model;
  const double theta = map.theta;
  const Eigen::Index n = model.size(), rows = model.G.rows();
  MatrixXd right(n, 2 * n + rows);
  right << model.M - h * (1 - theta) * model.C - h * h * theta * (1 - theta) * model.K, -h * model.K, h * model.H;
  right = solve_dense(model.M + h * theta * model.C + h * h * theta * theta * model.K, right,
                      "reduced model: a motion has neither mass nor stiffness");
  map.from_state = right.leftCols(2 * n);
  map.from_reactions = right.rightCols(rows);
  map.from_equilibrium = -map.from_reactions * VectorXd::Map(model.reactions.data(), rows);
  map.W = model.G * map.from_reactions;
  map.G_n = model.G(Eigen::seq(0, Eigen::last, 1 + model.directions), Eigen::all);
  map.W_single = map.W.cast<float>();
  map.W_n = map.W_single(Eigen::seq(0, Eigen::last, 1 + model.directions), Eigen::all);
  map.own.assign(model.active.size(), {});
  const Eigen::Index block = 1 + model.directions;
  for (Eigen::Index row = 0; row < rows; ++row)
    for (Eigen::Index k = 0, first = row - row % block; k < block; ++k)
      map.own[static_cast<std::size_t>(row / block)][static_cast<std::size_t>(row % block)]
             [static_cast<std::size_t>(k)] = (map.W(row, first + k) + map.W(first + k, row)) / 2;
  map.h = h;
}

namespace
{

/// s of the pair whose rows begin at `row`.
VectorXd sliding(const ReducedModel& model, const VectorXd& v, Eigen::Index row)
{
  const Eigen::Index d = model.directions;
  return model.G.middleRows(row + 1, d) * v -
         VectorXd::Map(&model.drive[static_cast<std::size_t>(row / (1 + d) * d)], d);
}

/// Closed pairs that stick or turn back oppose s+ alone, as in the full step: b without what s had to say there.
/// Returns whether there were any.
bool forget_where_turned(const ReducedMap& map, const VectorXd& v, ReducedContact& contact, VectorXd& b)
{
  const Eigen::Index d = map.model.directions, block = 1 + d;
  bool any = false;
  for (std::size_t i = 0; d > 0 && i < contact.opposes_end.size(); ++i)
  {
    const Eigen::Index row = static_cast<Eigen::Index>(i) * block;
    if (contact.opposes_end[i] || contact.r(row) <= 0) continue;
    const VectorXd earlier = (1 - map.theta) / map.theta * sliding(map.model, v, row);
    if ((contact.w.segment(row + 1, d) - earlier).dot(earlier) >= 0) continue;
    contact.opposes_end[i] = any = true;
    b.segment(row + 1, d) -= earlier;
  }
  return any;
}

} // namespace

bool sticks(const VectorXd& r, double friction)
{
  return r.tail(r.size() - 1).norm() < (1 - 1e-8) * friction * r(0);
}

bool advance(const ReducedMap& map, ReducedState& state, ReducedContact& contact)
{
  const ReducedModel& model = map.model;
  const double h = map.h, theta = map.theta, earlier = (1 - theta) / theta;
  const Eigen::Index n = model.size();
  VectorXd both(2 * n);
  both << state.v, state.q;
  VectorXd next = map.from_state * both + map.from_equilibrium;

  // b of w = W r + b: tangential rows are s+ + (1-theta)/theta s = s_theta/theta, normal ones gap rates
  // (g + G_n q~)/h + G_n v, q~ = q + h (1-theta) v
  VectorXd b = model.G * (next + earlier * state.v);
  const VectorXd position = map.G_n * (state.q + h * (1 - theta - earlier) * state.v);
  const auto block = static_cast<std::size_t>(1 + model.directions), directions = block - 1;
  for (std::size_t i = 0; i < model.gap.size(); ++i)
  {
    const auto row = static_cast<Eigen::Index>(i * block);
    b(row) += (model.gap[i] + position(static_cast<Eigen::Index>(i))) / h;
    for (std::size_t k = 0; k < directions; ++k)
      b(row + 1 + static_cast<Eigen::Index>(k)) -= (1 + earlier) * model.drive[i * directions + k];
  }
  contact.opposes_end.assign(model.gap.size(), false);
  for (std::size_t i = 0; directions > 0 && i < model.gap.size(); ++i)
  {
    const auto row = static_cast<Eigen::Index>(i * block), d = static_cast<Eigen::Index>(directions);
    if (contact.r(row) <= 0 || !sticks(contact.r.segment(row, 1 + d), model.friction)) continue;
    contact.opposes_end[i] = true; // its s is rounding
    b.segment(row + 1, d) -= earlier * sliding(model, state.v, row);
  }
  bool converged = solve_contact(map, b, contact);
  while (forget_where_turned(map, state.v, contact, b))
  {
    contact.r_before.resize(0); // no step lies between
    converged = solve_contact(map, b, contact);
  }
  next.noalias() += map.from_reactions * contact.r;
  state.q += h * (theta * next + (1 - theta) * state.v);
  state.v = std::move(next);
  return converged;
}

namespace
{

/// N steps from `state` on.
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
  ReducedContact contact{map.reactions};
  march(map, state, contact, watch);
  return state;
}

Passage pass(ReducedMap& map, double period, ReducedState state)
{
  prepare(map, period);
  ReducedContact contact{map.reactions};
  ReducedState last_but_one;
  int done = 0;
  march(map, state, contact,
        [&](const ReducedState& now)
        {
          if (++done == map.steps - 1) last_but_one = now;
        });
  Passage result{state, {}};
  (void)advance(map, state, contact);
  result.rate = {(state.q - last_but_one.q) / (2 * map.h), (state.v - last_but_one.v) / (2 * map.h)};
  return result;
}

} // namespace squeal
