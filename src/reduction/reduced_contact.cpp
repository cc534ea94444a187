/// The contact of the reduced model's active pairs as the eliminated ones let them move.
///
/// W is slightly unsymmetric (friction of the eliminated pairs) and far from local (a few shapes carry far), so the
/// solvers of contact/solver.hpp do not fit. The normal laws are swept over alone, each pair's friction turned as it
/// slides at the time: a row of W a pair, in single precision, since it acts on changes only. One product with W then
/// gives the rates, and pairs that still miss the law - those that stick or turn - are solved one by one.
#include "squeal/contact/solver.hpp"
#include "squeal/reduction/reduced_model.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

using Eigen::VectorXd;

constexpr int unread_at_most = 20; // products in single precision, and their extrapolation, gather rounding

struct Pairs
{
  const ReducedMap& map;
  VectorXd& r;
  VectorXd& w; // W r + b
  Eigen::Index block = 1 + map.model.directions;
  double friction = map.model.friction;

  PairVector of(const VectorXd& x, Eigen::Index i) const
  {
    PairVector own{};
    for (Eigen::Index k = 0; k < block; ++k) own[static_cast<std::size_t>(k)] = x(i + k);
    return own;
  }

  double defect(Eigen::Index i) const
  {
    const PairBlock& A = map.own[static_cast<std::size_t>(i / block)];
    return natural_map(of(r, i), of(w, i), friction, 1 / A[0][0], block > 1 ? 1 / std::max(A[1][1], A[2][2]) : 0);
  }
};

/// The pair's reaction becomes `next`, and w follows.
void react(Pairs& pairs, Eigen::Index i, const PairVector& next)
{
  for (Eigen::Index k = 0; k < pairs.block; ++k)
    if (const double change = next[static_cast<std::size_t>(k)] - pairs.r(i + k); change != 0)
    {
      pairs.r(i + k) += change;
      pairs.w += change * pairs.map.W.col(i + k);
    }
}

/// A warm start need not be admissible.
void admit(Pairs& pairs)
{
  for (Eigen::Index i = 0; i < pairs.r.size(); i += pairs.block)
  {
    PairVector first = pairs.of(pairs.r, i);
    first[0] = std::max(first[0], 0.);
    project_on_disc(first, pairs.friction);
    react(pairs, i, first);
  }
}

/// What a unit of a pair's normal reaction brings along: itself and, unless the pair sticks, friction against sliding.
PairVector push_of(const Pairs& pairs, Eigen::Index i)
{
  PairVector push{1, 0, 0};
  const PairVector r = pairs.of(pairs.r, i), w = pairs.of(pairs.w, i);
  const double speed = std::hypot(w[1], w[2]), held = std::hypot(r[1], r[2]);
  if (speed == 0 || (r[0] > 0 && held < (1 - 1e-8) * pairs.friction * r[0])) return push;
  push[1] = -pairs.friction * w[1] / speed;
  push[2] = -pairs.friction * w[2] / speed;
  return push;
}

/// What a normal reaction does to the normal rates with the friction it brings along, by pairs.
Eigen::MatrixXf along_pushes(const Pairs& pairs)
{
  const Eigen::MatrixXf& W = pairs.map.W_n;
  Eigen::MatrixXf along(W.rows(), W.rows());
  for (Eigen::Index j = 0; j < W.rows(); ++j)
  {
    const PairVector push = push_of(pairs, j * pairs.block);
    along.col(j) = W.col(j * pairs.block);
    for (Eigen::Index k = 1; k < pairs.block; ++k)
      along.col(j) += static_cast<float>(push[static_cast<std::size_t>(k)]) * W.col(j * pairs.block + k);
  }
  return along;
}

/// Sweeps over the normal laws until no reaction changes by more than `enough`; r changes, w does not yet.
void sweep_normals(Pairs& pairs, const Eigen::MatrixXf& along, double enough)
{
  VectorXd& r = pairs.r;
  const Eigen::Index count = along.rows(), block = pairs.block;
  std::vector<PairVector> push;
  Eigen::VectorXf dw = Eigen::VectorXf::Zero(count);
  for (Eigen::Index i = 0; i < r.size(); i += block)
  {
    const PairVector p = push.emplace_back(push_of(pairs, i));
    if (p[1] == 0 && p[2] == 0) continue; // sticks
    for (Eigen::Index k = 1; k < block; ++k) r(i + k) = p[static_cast<std::size_t>(k)] * r(i);
  }
  constexpr double relaxation = 1.2;
  double largest = HUGE_VAL;
  for (int sweep = 0; largest > enough && sweep < 50; ++sweep)
  {
    largest = 0;
    for (Eigen::Index j = 0; j < count; ++j)
    {
      const Eigen::Index i = j * block;
      const double rate = pairs.w(i) + static_cast<double>(dw(j));
      const double change = std::max(-r(i), -relaxation * rate / static_cast<double>(along(j, j)));
      if (std::abs(change) <= enough / 8) continue;
      largest = std::max(largest, std::abs(change));
      for (Eigen::Index k = 0; k < block; ++k)
        r(i + k) += change * push[static_cast<std::size_t>(j)][static_cast<std::size_t>(k)];
      add_rows(along.col(j).data(), static_cast<std::size_t>(count), 1, {change, 0, 0}, dw.data());
    }
  }
}

/// One sweep over the pairs that miss their law by more than `limit`, each solved whole; the local solves see the
/// symmetric part of W's own blocks, which leaves the fixed point what it is.
void sweep_pairs(Pairs& pairs, double limit)
{
  const ReducedMap& map = pairs.map;
  for (Eigen::Index i = 0; i < pairs.r.size(); i += pairs.block)
  {
    if (pairs.defect(i) <= limit) continue;
    const PairBlock& A = map.own[static_cast<std::size_t>(i / pairs.block)];
    const PairVector last = pairs.of(pairs.r, i);
    PairVector q = pairs.of(pairs.w, i);
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t l = 0; l < 3; ++l) q[k] -= A[k][l] * last[l];
    react(pairs, i, solve_pair(A, q, map.model.directions, pairs.friction, last));
  }
}

double largest_defect(const Pairs& pairs)
{
  double worst = 0;
  for (Eigen::Index i = 0; i < pairs.r.size(); i += pairs.block) worst = std::max(worst, pairs.defect(i));
  return worst;
}

/// W x in single precision.
VectorXd product_single(const ReducedMap& map, const VectorXd& x)
{
  const auto rows = static_cast<std::size_t>(x.size()), block = static_cast<std::size_t>(1 + map.model.directions);
  std::vector<float> result(rows, 0);
  for (std::size_t i = 0; i < rows; i += block)
  {
    PairVector own{};
    std::copy_n(&x(static_cast<Eigen::Index>(i)), block, own.begin());
    if (own != PairVector{}) add_rows(&map.W_single(0, static_cast<Eigen::Index>(i)), rows, block, own, result.data());
  }
  return Eigen::VectorXf::Map(result.data(), x.size()).cast<double>();
}

/// Linear in time.
void extrapolate(const ReducedMap& map, ReducedContact& contact)
{
  if (contact.unread >= unread_at_most || contact.Wr.size() == 0)
  {
    contact.Wr = map.W * contact.r;
    contact.r_before.resize(0); // the step before's product has gathered rounding, too
    contact.unread = 0;
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
  Pairs pairs{map, r, contact.w};
  admit(pairs);
  if (contact.unread++ == 0) contact.along = along_pushes(pairs);
  double worst = HUGE_VAL;
  bool converged = false;
  for (int pass = 0; pass < map.contact.max_iterations; ++pass)
  {
    const double tolerance = map.contact.tolerance * r.cwiseAbs().maxCoeff(), last = worst;
    worst = largest_defect(pairs);
    converged = worst <= tolerance;
    if (converged) break;
    if (worst < last / 2)
    {
      const VectorXd before = r;
      sweep_normals(pairs, contact.along, std::max(tolerance / 4, 1e-6 * worst));
      contact.w += product_single(map, r - before);
    }
    else // friction that the normal sweeps do not see
      sweep_pairs(pairs, .01 * tolerance);
  }
  contact.Wr = contact.w - b;
  return converged;
}

} // namespace squeal
