/// The contact of the reduced model's active pairs as the eliminated ones let them move.
///
/// W is slightly unsymmetric (friction of the eliminated pairs) and far from local (a few shapes carry far), so the
/// solvers of contact/solver.hpp do not fit. The normal laws are swept over alone, each pair's friction turned as it
/// slides at the time. A pair has one row of W, in single precision, since it acts on changes only. One product with W
/// then gives the rates, and pairs that still miss the law - those that stick or turn - are solved one by one.
#include "reduced_contact.hpp"
#include "squeal/contact/force_scale.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::VectorXd;

constexpr int unread_at_most = 20; // products in single precision, and their extrapolation, gather rounding

struct Iterate
{
  const ReducedMap& map;
  VectorXd& r;
  VectorXd& w;      // W r + b
  double speed = 0; // [m/s] the largest of b
  int directions = map.model.directions;
  PairFriction friction = law_of_step(map.model.friction, map.theta);
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
                    admissible(iterate.reaction(pair), iterate.velocity(pair), iterate.friction.of(pair)));
}

/// What a unit of each pair's normal reaction goes with: itself and, unless the pair sticks, friction against
/// sliding.
std::vector<PairVector> unit_reactions(const Iterate& iterate)
{
  const std::vector<ContactStatus> status =
      contact_status(PairView<const double>(iterate.r, iterate.directions),
                     PairView<const double>(iterate.w, iterate.directions), iterate.friction);
  std::vector<PairVector> result;
  for (std::size_t pair = 0; pair < iterate.pairs(); ++pair)
  {
    PairVector& unit = result.emplace_back(PairVector{1, 0, 0});
    const PairVector w = iterate.velocity(pair);
    const double speed = length(w[1], w[2]);
    if (speed == 0 || status[pair] == ContactStatus::stick) continue;
    const double mu = friction_coefficient(iterate.friction.of(pair), speed).value;
    unit[1] = -mu * w[1] / speed;
    unit[2] = -mu * w[2] / speed;
  }
  return result;
}

/// What a normal reaction does to the normal rates with the friction it brings along, by pairs.
Eigen::MatrixXf normal_responses(const Iterate& iterate)
{
  const Eigen::MatrixXf& W = iterate.map.W_n;
  const std::vector<PairVector> unit = unit_reactions(iterate);
  Eigen::MatrixXf responses(W.rows(), W.rows());
  for (Index j = 0; j < W.rows(); ++j)
  {
    responses.col(j) = W.col(iterate.rows.normal(j));
    for (Index k = 1; k < iterate.rows.per_pair(); ++k)
      responses.col(j) += static_cast<float>(unit[static_cast<std::size_t>(j)][static_cast<std::size_t>(k)]) *
                          W.col(iterate.rows.normal(j) + k);
  }
  return responses;
}

/// Sweeps over the normal laws until no reaction changes by more than `enough`; r changes, w does not yet.
void sweep_normals(Iterate& iterate, const Eigen::MatrixXf& responses, double enough)
{
  const PairView<double> r(iterate.r, iterate.directions);
  const PairView<const double> w(iterate.w, iterate.directions);
  const std::vector<PairVector> unit = unit_reactions(iterate);
  const std::size_t count = iterate.pairs();
  Eigen::VectorXf dw = Eigen::VectorXf::Zero(responses.rows());
  for (std::size_t i = 0; i < count; ++i)
    if (unit[i][1] != 0 || unit[i][2] != 0) r.set(i, r.normal(i) * unit[i]);
  constexpr double relaxation = 1.2;
  double largest = HUGE_VAL;
  for (int sweep = 0; largest > enough && sweep < 50; ++sweep)
  {
    largest = 0;
    for (std::size_t i = 0; i < count; ++i)
    {
      const auto row = static_cast<Index>(i);
      const double rate = w.normal(i) + static_cast<double>(dw(row));
      const double change = std::max(-r.normal(i), -relaxation * rate / static_cast<double>(responses(row, row)));
      if (std::abs(change) <= enough / 8) continue;
      largest = std::max(largest, std::abs(change));
      r.set(i, r.vector(i) + change * unit[i]);
      add_rows(responses.col(row).data(), count, 1, {change, 0, 0}, dw.data());
    }
  }
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

/// The largest force scale of a pair [N].
double largest_scale(const Iterate& iterate)
{
  const double largest = iterate.r.cwiseAbs().maxCoeff();
  double scale = 0;
  for (const PairBlock& own : iterate.map.own)
    scale = std::max(scale, force_scale(natural_scale(own, 0), iterate.speed, largest));
  return scale;
}

/// W x in single precision.
VectorXd product_single(const ReducedMap& map, const VectorXd& x)
{
  const PairRows<Index> rows(map.model.directions);
  const auto size = static_cast<std::size_t>(x.size()), per_pair = static_cast<std::size_t>(rows.per_pair());
  std::vector<float> result(size, 0);
  for (std::size_t pair = 0; pair < map.own.size(); ++pair)
  {
    const PairVector own = PairView(x, map.model.directions).vector(pair);
    const float* columns = map.W_single.col(rows.normal(static_cast<Index>(pair))).data();
    if (own != PairVector{}) add_rows(columns, size, per_pair, own, result.data());
  }
  return Eigen::VectorXf::Map(result.data(), x.size()).cast<double>();
}

/// Linear in time.
void extrapolate(const ReducedMap& map, ReducedContact& contact)
{
  if (contact.since_read >= unread_at_most || contact.Wr.size() == 0)
  {
    contact.Wr = map.W * contact.r;
    contact.r_before.resize(0); // the step before's product has gathered rounding, too
    contact.since_read = 0;
  }
  const bool alone = contact.r_before.size() == 0;
  const VectorXd r = alone ? contact.r : VectorXd(2 * contact.r - contact.r_before);
  const VectorXd Wr = alone ? contact.Wr : VectorXd(2 * contact.Wr - contact.Wr_before);
  contact.r_before = std::exchange(contact.r, r);
  contact.Wr_before = std::exchange(contact.Wr, Wr);
}

} // namespace

bool solve_contact(const ReducedMap& map, const VectorXd& b, ReducedContact& contact)
{
  if (b.size() == 0) return true;
  extrapolate(map, contact);
  contact.w = b + contact.Wr;
  VectorXd& r = contact.r;
  Iterate iterate{map, r, contact.w, b.cwiseAbs().maxCoeff()};
  admit(iterate);
  if (contact.since_read++ == 0) contact.normal_responses = normal_responses(iterate);
  double worst = HUGE_VAL;
  bool converged = false;
  for (int pass = 0; pass < map.contact.max_iterations; ++pass)
  {
    const double tolerance = map.contact.tolerance, last = worst;
    worst = largest_defect(iterate);
    converged = worst <= tolerance;
    if (converged) break;
    if (worst < last / 2)
    {
      const VectorXd before = r;
      sweep_normals(iterate, contact.normal_responses, std::max(tolerance / 4, 1e-6 * worst) * largest_scale(iterate));
      contact.w += product_single(map, r - before);
    }
    else // friction that the normal sweeps do not see
      sweep_pairs(iterate, 0.01 * tolerance);
  }
  contact.Wr = contact.w - b;
  return converged;
}

} // namespace squeal
