/// The contact of the reduced model's active pairs as the eliminated ones let them move.
///
/// W is slightly unsymmetric (friction of the eliminated pairs) and far from local (a few shapes carry far), so the
/// solvers of contact/solver.hpp do not fit. Block Gauss-Seidel solves the pairs one by one; w follows each change.
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
  Iterate iterate{map, contact.r, contact.w, b.cwiseAbs().maxCoeff()};
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

} // namespace squeal
