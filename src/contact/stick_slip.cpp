#include "squeal/contact/stick_slip.hpp"

#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <boost/math/tools/roots.hpp>
#include <cmath>
#include <Eigen/Dense>
#include <limits>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double tight = 1e-12, good = 1e-9; // of the residual: where iterations end, and what counts as solved
constexpr double rounding = 1e-9;            // of the largest reaction: a pair that only grazes is no open one

Vector3d entries(const VectorXd& x, std::size_t pair, int directions)
{
  const PairVector v = PairView<const double>(x, directions).vector(pair);
  return {v[0], v[1], v[2]};
}

/// Forces taken to the cone of friction, with the derivative by those before.
struct Projected
{
  Vector3d p = Vector3d::Zero();
  Matrix3d J = Matrix3d::Zero();
};

/// The root l >= 0 of l (1 - x^2/(1 + l)^2) = e^2: a force of length x is taken into the disc of radius 1 by 1/(1 + l).
double shrinking(double x, double e)
{
  const double least = std::max(0., x - 1);
  if (e == 0) return least;
  const double most = least + 1 + 2 * e * e;
  const auto excess = [&](double l)
  {
    const double inside = (1 + l - x) * (1 + l + x) / ((1 + l) * (1 + l));
    return std::pair{l * inside - e * e, inside + 2 * l * x * x / ((1 + l) * (1 + l) * (1 + l))};
  };
  std::uintmax_t evaluations = 200;
  return boost::math::tools::newton_raphson_iterate(excess, most, least, most, 52, evaluations);
}

/// A pair before a step of the iteration.
struct PairState
{
  Vector3d r, w;
  double mu;
  Eigen::Vector2d e; // of the drive; zero: it has none
  NaturalScale rho;
  double grazing; // [N] that no sign is read from
  double smooth;  // [N] by which corners of the law are rounded off

  double pressing() const { return r[0] - rho.normal * w[0]; }
  Eigen::Vector2d pulling() const { return r.tail<2>() - rho.tangential * w.tail<2>(); }

  ContactStatus status() const
  {
    if (pressing() < -grazing) return ContactStatus::open;
    const bool sticks = e.isZero(0) && mu > 0 && pulling().norm() <= mu * pressing();
    return sticks ? ContactStatus::stick : ContactStatus::slip;
  }

  /// proj(r - rho w) with the disc of the projected normal reaction.
  Projected projected() const
  {
    Projected to;
    const double h = pressing(), root = std::hypot(h, 2 * smooth);
    to.p[0] = h > 0 ? (h + root) / 2 : smooth == 0 ? 0 : 2 * smooth * (smooth / (root - h));
    to.J(0, 0) = smooth > 0 ? to.p[0] / root : status() != ContactStatus::open;
    if (!e.isZero(0))
    {
      to.p.tail<2>() = mu * to.p[0] * e;
      to.J.block<2, 1>(1, 0) = mu * to.J(0, 0) * e;
      return to;
    }
    const Eigen::Vector2d t = pulling();
    if (const double radius = mu * to.p[0]; radius > 0)
    {
      const Eigen::Vector2d T = t / radius;
      const double x = T.norm(), l = shrinking(x, smooth / radius), m = 1 + l,
                   c = smooth > 0 ? smooth / radius / l * (smooth / radius) : std::max(0., 1 - x * x),
                   along = l > 0 ? 2 * l / (m * m * (c + 2 * l * x * x / (m * m * m))) : 0;
      to.p.tail<2>() = t / m;
      to.J.bottomRightCorner<2, 2>() = Eigen::Matrix2d::Identity() / m - along / (m * m) * T * T.transpose();
      to.J.block<2, 1>(1, 0) = along * mu * to.J(0, 0) * T;
    }
    else if (mu > 0 && t.norm() > 0)
      to.J.block<2, 1>(1, 0) = mu * to.J(0, 0) * t.normalized();
    return to;
  }
};

/// All pairs before a step of the iteration.
struct PairStates
{
  const StickSlipOperator& of;
  const StickSlipFriction& friction;
  const StickSlipState& at;
  double smooth;
  double grazing = rounding * at.r.lpNorm<Eigen::Infinity>();

  PairState operator[](std::size_t pair) const
  {
    const std::span<const double> e = TangentView<const double>(friction.e, of.directions).of(pair);
    return {entries(at.r, pair, of.directions),
            entries(at.w, pair, of.directions),
            friction.mu[pair],
            {e[0], e.size() > 1 ? e[1] : 0},
            of.rho[pair],
            grazing,
            smooth};
  }

  /// The laws' defect [N], r - proj(r - rho w).
  VectorXd defects() const
  {
    VectorXd result = at.r;
    const PairRows<Index> rows(of.directions);
    for (std::size_t pair = 0; pair < of.rho.size(); ++pair)
      result.segment(rows.normal(static_cast<Index>(pair)), rows.per_pair()) -=
          (*this)[pair].projected().p.head(rows.per_pair());
    return result;
  }
};

VectorXd times_M(const StickSlipOperator& of, const VectorXd& r)
{
  return of.M.size() > 0 ? VectorXd(of.M * r) : r;
}

/// |N w - q - M r| over the part of load and reactions in it. Motions are no measure: bodies that nothing holds go far.
double imbalance(const StickSlipOperator& of, const VectorXd& q, const StickSlipState& at)
{
  const double per_force = of.M.size() > 0 ? of.compliance : 1,
               scale = std::max(q.lpNorm<Eigen::Infinity>(), per_force * at.r.lpNorm<Eigen::Infinity>());
  return scale > 0 ? (of.N * at.w - q - times_M(of, at.r)).lpNorm<Eigen::Infinity>() / scale : 0;
}

} // namespace

StickSlipOperator make_stick_slip_operator(MatrixXd N, MatrixXd M, int directions, std::vector<int> contact)
{
  StickSlipOperator result{std::move(N), std::move(M), directions, {}, 0, std::move(contact)};
  result.compliance = result.M.diagonal().maxCoeff();
  for (Index row = 0; row < result.M.rows(); ++row) // neither side moves along it: a spring there carries nothing
    if (result.M.row(row).isZero(0)) result.M(row, row) = result.compliance;
  const PairRows<Index> rows(directions);
  for (Index pair = 0; pair < static_cast<Index>(result.contact.size()); ++pair)
  {
    PairBlock own{};
    for (Index k = 0; k < rows.per_pair(); ++k)
      own[static_cast<std::size_t>(k)][static_cast<std::size_t>(k)] =
          result.M(rows.normal(pair) + k, rows.normal(pair) + k);
    result.rho.push_back(natural_scale(own, result.compliance));
  }
  return result;
}

namespace
{

/// The smallest pivot over the largest.
double pivot_ratio(const Eigen::PartialPivLU<MatrixXd>& factors)
{
  const VectorXd pivots = factors.matrixLU().diagonal().cwiseAbs();
  return pivots.minCoeff() / pivots.maxCoeff();
}

} // namespace

std::optional<DividedOperator> divided(StickSlipOperator& of)
{
  constexpr double dependent = 1e-8; // forces would lose as many digits
  Eigen::PartialPivLU<MatrixXd> by(of.M);
  // a pivot of zero has no estimate of the condition
  if (!(pivot_ratio(by) > dependent && by.rcond() > dependent)) return std::nullopt;
  of.N = by.solve(of.N).eval();
  of.M.resize(0, 0);
  return DividedOperator{std::move(of), std::move(by)};
}

double stick_slip_residual(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at,
                           double least)
{
  const VectorXd defects = PairStates{of, friction, at, 0}.defects();
  const auto size_in = [&](const VectorXd& x)
  { return [&](std::size_t pair) { return entries(x, pair, of.directions).norm(); }; };
  const std::vector<double> scale = largest_of_contacts(of.contact, of.rho.size(), size_in(at.r));
  double worst = 0;
  for (std::size_t pair = 0; pair < of.rho.size(); ++pair)
    if (const double defect = size_in(defects)(pair); defect > 0)
      worst = std::max(worst, defect / std::max(least, scale[static_cast<std::size_t>(of.contact[pair])]));
  return worst;
}

StatusSystem::StatusSystem(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at)
    : StatusSystem(of, friction, at, {})
{
}

StatusSystem::StatusSystem(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at,
                           const Softening& soft)
    : of_(of), own_(PairRows<Index>(of.directions).per_pair())
{
  const PairRows<Index> rows(of.directions);
  const bool whole = of.M.size() > 0;
  const PairStates states{of, friction, at, soft.force};
  particular_ = {-at.r, VectorXd::Zero(at.r.size())};
  for (std::size_t pair = 0; pair < of.rho.size(); ++pair)
  {
    const PairState state = states[pair];
    statuses_.push_back(state.status());
    const Index first = rows.normal(static_cast<Index>(pair));
    const Vector3d motion(1 / state.rho.normal, 1 / state.rho.tangential, 1 / state.rho.tangential); // of a unit force
    const Projected to = state.projected();
    laws_.push_back({to.J, motion.asDiagonal() * (to.J - Matrix3d::Identity())});
    particular_.r.segment(first, own_) += to.p.head(own_);
    particular_.w.segment(first, own_) = motion.head(own_).cwiseProduct(particular_.r.segment(first, own_));
    if (!whole && soft.force == 0 && statuses_.back() == ContactStatus::stick) continue;
    unknown_.push_back(pair);
    for (Index k = 0; k < own_; ++k) rows_.push_back(first + k);
  }
  factor(soft);
}

void StatusSystem::factor(const Softening& soft)
{
  const PairRows<Index> rows(of_.directions);
  const auto size = static_cast<Index>(rows_.size());
  const bool whole = of_.M.size() > 0;
  MatrixXd matrix(size, size), of_pair(size, own_);
  for (std::size_t i = 0; i < unknown_.size(); ++i)
  {
    const auto& [R, W] = laws_[unknown_[i]];
    const Index first = rows.normal(static_cast<Index>(unknown_[i])), to = rows.normal(static_cast<Index>(i));
    auto columns = matrix.middleCols(to, own_);
    const MatrixXd motion = -W.topLeftCorner(own_, own_), reaction = (R - soft.spring * W).topLeftCorner(own_, own_);
    of_pair = of_.N.middleCols(first, own_)(rows_, Eigen::all);
    columns.noalias() = of_pair.lazyProduct(motion);
    if (whole)
    {
      of_pair = of_.M.middleCols(first, own_)(rows_, Eigen::all);
      columns.noalias() += of_pair.lazyProduct(reaction);
    }
    else
      columns.middleRows(to, own_) += reaction;
    for (Index k = 0; k < own_; ++k) // a row in which neither side moves leaves its friction open: it stays
      if (columns.col(k).isZero(0)) columns(to + k, k) = 1;
  }
  if (size == 0) return;
  factors_.compute(matrix);
  if (pivot_ratio(factors_) > 1e-13) return;
  // rows of pairs that depend on each other: a compliance in series with each shares what they carry
  constexpr double series = 1e-10; // of the largest pivot
  matrix.diagonal().array() += series * factors_.matrixLU().diagonal().cwiseAbs().maxCoeff();
  factors_.compute(matrix);
}

StickSlipState StatusSystem::response(const VectorXd& rhs) const
{
  StickSlipState result{VectorXd::Zero(of_.N.rows()), VectorXd::Zero(of_.N.rows())};
  const PairRows<Index> rows(of_.directions);
  if (!unknown_.empty())
  {
    const VectorXd y = factors_.solve(-rhs(rows_));
    for (std::size_t i = 0; i < unknown_.size(); ++i)
    {
      const auto& [R, W] = laws_[unknown_[i]];
      const Index first = rows.normal(static_cast<Index>(unknown_[i]));
      const auto of_pair = y.segment(rows.normal(static_cast<Index>(i)), own_);
      result.r.segment(first, own_) = R.topLeftCorner(own_, own_) * of_pair;
      result.w.segment(first, own_) = W.topLeftCorner(own_, own_) * of_pair;
    }
  }
  if (unknown_.size() == statuses_.size()) return result;
  const VectorXd forces = of_.N * result.w - rhs;
  for (std::size_t pair = 0; pair < statuses_.size(); ++pair)
    if (statuses_[pair] == ContactStatus::stick)
      result.r.segment(rows.normal(static_cast<Index>(pair)), own_) =
          forces.segment(rows.normal(static_cast<Index>(pair)), own_);
  return result;
}

StickSlipState StatusSystem::change(const VectorXd& rhs, const Softening& soft) const
{
  StickSlipState result =
      response(rhs - of_.N * particular_.w + times_M(of_, particular_.r - soft.spring * particular_.w));
  result.r += particular_.r;
  result.w += particular_.w;
  return result;
}

int StatusSystem::index() const
{
  if (unknown_.empty()) return 1;
  const auto negative = (factors_.matrixLU().diagonal().array() < 0).count();
  return factors_.permutationP().determinant() * (negative % 2 == 0 ? 1 : -1) > 0 ? 1 : -1;
}

double StatusSystem::reciprocal_condition() const
{
  return unknown_.empty() ? 1 : pivot_ratio(factors_);
}

namespace
{

StickSlipState beyond(const StickSlipState& at, double part, const StickSlipState& change)
{
  return {at.r + part * change.r, at.w + part * change.w};
}

/// One increment that is being solved.
struct Increment
{
  const StickSlipOperator& of;
  const StickSlipFriction& friction;
  const VectorXd& q;
  StickSlipSolution best{}; // so far

  /// The rest of N w = q + M r, with springs from another state on.
  VectorXd rest(const StickSlipState& at, double spring, const VectorXd& from) const
  {
    return q - of.N * at.w + times_M(of, at.r - spring * (at.w - from));
  }

  /// Whether iterations end here: there is a solution, or none to be had.
  bool ends_at(const StickSlipState& at, double enough)
  {
    if (is_asked_here()) throw Interrupted{};
    const double residual = std::max(stick_slip_residual(of, friction, at, of.least_force(q)), imbalance(of, q, at));
    if (!(residual >= best.residual)) best = {at, best.iterations, residual, residual <= good};
    return residual <= enough || !std::isfinite(at.r.sum() + at.w.sum());
  }

  /// The sum of squares that a smoothed step lessens [N^2].
  double merit(const StickSlipState& at, double smooth, const VectorXd& lacking) const
  {
    const double per_force = of.M.size() > 0 ? of.compliance : 1;
    return PairStates{of, friction, at, smooth}.defects().squaredNorm() + (lacking / per_force).squaredNorm();
  }

  /// The part of a step by which the merit falls from that where `now` is lacking; `least` where no part lessens it.
  double part_of(const StickSlipState& at, const StickSlipState& change, double smooth, const VectorXd& now,
                 double least) const
  {
    const double size = merit(at, smooth, now);
    const auto lessens = [&](double part)
    { return merit(beyond(at, part, change), smooth, (1 - part) * now) < (1 - 1e-4 * part) * size; };
    double part = 1;
    while (part > least && !lessens(part)) part /= 2;
    return part;
  }

  /// Newton's method on the statuses, which near a solution ends in a few iterations.
  void by_statuses(StickSlipState at)
  {
    constexpr int most = 12;
    for (int iteration = 0; !ends_at(at, tight) && iteration < most; ++iteration, ++best.iterations)
    {
      const VectorXd now = rest(at, 0, at.w);
      const StickSlipState change = StatusSystem(of, friction, at).change(now, {});
      at = beyond(at, part_of(at, change, 0, now, 0x1p-8), change);
    }
  }

  /// The path of laws with rounded corners to those of Coulomb (src/README.md, section 2.9).
  void by_smoothing(StickSlipState at);
};

void Increment::by_smoothing(StickSlipState at)
{
  constexpr int most = 200;
  constexpr double sharper = 0.1, least_part = 0x1p-12, least = 1e-15;
  const double first = of.motion(q) / of.compliance, pairs = static_cast<double>(of.rho.size());
  Softening soft{first, 1 / of.compliance};
  VectorXd from = at.w;
  const auto lacking = [&] { return rest(at, soft.spring, from); };
  const auto is_close = [&]
  { return soft.force > least * first && merit(at, soft.force, lacking()) < soft.force * soft.force * pairs; };
  const auto sharpen = [&] { soft = {sharper * soft.force, sharper * soft.spring}; };
  while (is_close()) sharpen(); // to where the start is no solution
  for (int iteration = 0; !ends_at(at, good) && iteration < most; ++iteration, ++best.iterations)
  {
    if (is_close()) // once a step: a corner much sharper than the last one is as hard as Coulomb's own
    {
      sharpen();
      from = at.w;
    }
    const VectorXd now = lacking();
    const StickSlipState change = StatusSystem(of, friction, at, soft).change(now, soft);
    const double part = part_of(at, change, soft.force, now, least_part);
    if (part == least_part) return; // rounding
    at = beyond(at, part, change);
  }
}

} // namespace

StickSlipSolution solve_stick_slip(const StickSlipOperator& of, const StickSlipFriction& friction, const VectorXd& q,
                                   const StickSlipState& guess)
{
  Increment increment{of, friction, q, {guess, 0, std::numeric_limits<double>::infinity(), false}};
  increment.by_statuses(guess);
  if (increment.best.converged || of.motion(q) == 0) return increment.best;
  increment.by_smoothing(guess);
  increment.by_statuses(StickSlipState(increment.best.state));
  return increment.best;
}

} // namespace squeal
