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

struct StatusFactors
{
  std::vector<Matrix3d> laws;        // J of each pair
  double spring = 0;                 // [N/m] across rows
  std::vector<std::size_t> unknown;  // pairs of the system; the others stick and leave it
  std::vector<Index> rows, stuck;    // of the former, and of the latter
  bool regular = true;               // no row was mended
  Eigen::PartialPivLU<MatrixXd> own; // of `rows`
};

namespace
{

/// Motions of a pair by its unknowns, [m/N].
Matrix3d motion_law(const StickSlipOperator& of, std::size_t pair, const Matrix3d& J)
{
  const NaturalScale& rho = of.rho[pair];
  return Vector3d(1 / rho.normal, 1 / rho.tangential, 1 / rho.tangential).asDiagonal() * (J - Matrix3d::Identity());
}

/// Columns of M R - N W in some rows, for reactions R y and motions W y of a pair.
MatrixXd columns_by(const StickSlipOperator& of, std::size_t pair, const Matrix3d& R, const Matrix3d& W)
{
  const PairRows<Index> pair_rows(of.directions);
  const Index own = pair_rows.per_pair(), first = pair_rows.normal(static_cast<Index>(pair));
  MatrixXd columns = of.N.middleCols(first, own).lazyProduct(-W.topLeftCorner(own, own));
  if (of.M.size() > 0)
    columns.noalias() += of.M.middleCols(first, own).lazyProduct(R.topLeftCorner(own, own));
  else
    columns.middleRows(first, own) += R.topLeftCorner(own, own);
  return columns;
}

/// The motions by the unknowns y of pairs, all of whose rows these are.
MatrixXd motions_by(const StickSlipOperator& of, const std::vector<Matrix3d>& laws, const MatrixXd& y)
{
  const PairRows<Index> rows(of.directions);
  const Index own = rows.per_pair();
  MatrixXd w(y.rows(), y.cols());
  for (std::size_t pair = 0; pair < laws.size(); ++pair)
  {
    const Index first = rows.normal(static_cast<Index>(pair));
    w.middleRows(first, own) =
        motion_law(of, pair, laws[pair]).topLeftCorner(own, own).lazyProduct(y.middleRows(first, own));
  }
  return w;
}

/// (M R - N W)^-1 times columns, by the laws of the factors.
MatrixXd solved(const StickSlipOperator& of, const StatusFactors& by, const MatrixXd& columns)
{
  MatrixXd y = MatrixXd::Zero(columns.rows(), columns.cols());
  if (!by.rows.empty()) y(by.rows, Eigen::all) = by.own.solve(MatrixXd(columns(by.rows, Eigen::all))).eval();
  if (by.stuck.empty()) return y;
  const MatrixXd forces = columns + of.N * motions_by(of, by.laws, y);
  y(by.stuck, Eigen::all) = forces(by.stuck, Eigen::all);
  return y;
}

} // namespace

StatusSystem::StatusSystem(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at)
    : of_(of)
{
  read_laws(friction, at, 0);
  factor(0);
}

StatusSystem::StatusSystem(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at,
                           const Softening& soft, double near, std::shared_ptr<const StatusFactors>& factors)
    : of_(of), factors_(factors)
{
  read_laws(friction, at, soft.force);
  if (!factors_ || factors_->spring != soft.spring || !differ_by_rank(near)) factor(soft.spring);
  factors = factors_;
}

void StatusSystem::read_laws(const StickSlipFriction& friction, const StickSlipState& at, double smooth)
{
  const PairRows<Index> rows(of_.directions);
  const Index own = rows.per_pair();
  const PairStates states{of_, friction, at, smooth};
  particular_ = {-at.r, VectorXd::Zero(at.r.size())};
  for (std::size_t pair = 0; pair < of_.rho.size(); ++pair)
  {
    const PairState state = states[pair];
    statuses_.push_back(state.status());
    const Index first = rows.normal(static_cast<Index>(pair));
    const Vector3d motion(1 / state.rho.normal, 1 / state.rho.tangential, 1 / state.rho.tangential); // of a unit force
    const Projected to = state.projected();
    laws_.push_back(to.J);
    particular_.r.segment(first, own) += to.p.head(own);
    particular_.w.segment(first, own) = motion.head(own).cwiseProduct(particular_.r.segment(first, own));
  }
}

bool StatusSystem::differ_by_rank(double near)
{
  constexpr Index most = 6; // one in so many rows: more cost about as much as factors
  if (!factors_->regular) return false;
  const PairRows<Index> rows(of_.directions);
  const Index own = rows.per_pair();
  std::vector<std::size_t> pairs;
  for (std::size_t pair = 0; pair < laws_.size(); ++pair)
    if ((laws_[pair] - factors_->laws[pair]).lpNorm<Eigen::Infinity>() > near) pairs.push_back(pair);
  const Index count = own * static_cast<Index>(pairs.size());
  if (most * count > of_.N.rows()) return false;
  MatrixXd changes(of_.N.rows(), count);
  std::vector<Matrix3d> laws = factors_->laws;
  for (const std::size_t pair : pairs)
  {
    const Matrix3d R = laws_[pair] - laws[pair], W = motion_law(of_, pair, R + Matrix3d::Identity());
    changes.middleCols(static_cast<Index>(changed_.size()), own) = columns_by(of_, pair, R - factors_->spring * W, W);
    for (Index k = 0; k < own; ++k) changed_.push_back(rows.normal(static_cast<Index>(pair)) + k);
    laws[pair] = laws_[pair];
  }
  laws_ = std::move(laws);
  if (pairs.empty()) return true;
  by_changes_ = solved(of_, *factors_, changes);
  own_.compute(MatrixXd::Identity(count, count) + by_changes_(changed_, Eigen::all));
  return true;
}

void StatusSystem::factor(double spring)
{
  const PairRows<Index> rows(of_.directions);
  const Index own = rows.per_pair();
  StatusFactors made{laws_, spring, {}, {}, {}, true, {}};
  for (std::size_t pair = 0; pair < laws_.size(); ++pair)
  {
    const bool leaves = of_.M.size() == 0 && laws_[pair].topLeftCorner(own, own).isIdentity(0);
    if (!leaves) made.unknown.push_back(pair);
    for (Index k = 0; k < own; ++k)
      (leaves ? made.stuck : made.rows).push_back(rows.normal(static_cast<Index>(pair)) + k);
  }
  const auto size = static_cast<Index>(made.rows.size());
  MatrixXd matrix(size, size);
  for (std::size_t i = 0; i < made.unknown.size(); ++i)
  {
    const std::size_t pair = made.unknown[i];
    const Index to = rows.normal(static_cast<Index>(i));
    const Matrix3d W = motion_law(of_, pair, laws_[pair]);
    matrix.middleCols(to, own) = columns_by(of_, pair, laws_[pair] - spring * W, W)(made.rows, Eigen::all);
    for (Index k = to; k < to + own; ++k) // a row in which neither side moves leaves its friction open: it stays
      if (matrix.col(k).isZero(0))
      {
        matrix(k, k) = 1;
        made.regular = false;
      }
  }
  if (size > 0)
  {
    made.own.compute(matrix);
    if (!(pivot_ratio(made.own) > 1e-13))
    {
      // rows of pairs that depend on each other: a compliance in series with each shares what they carry
      constexpr double series = 1e-10; // of the largest pivot
      matrix.diagonal().array() += series * made.own.matrixLU().diagonal().cwiseAbs().maxCoeff();
      made.own.compute(matrix);
      made.regular = false;
    }
  }
  factors_ = std::make_shared<const StatusFactors>(std::move(made));
}

StickSlipState StatusSystem::response(const VectorXd& rhs) const
{
  VectorXd y = solved(of_, *factors_, -rhs);
  if (!changed_.empty()) y -= by_changes_ * own_.solve(y(changed_));
  StickSlipState result{y, motions_by(of_, laws_, y)};
  const PairRows<Index> rows(of_.directions);
  const Index own = rows.per_pair();
  for (std::size_t pair = 0; pair < laws_.size(); ++pair)
  {
    const Index first = rows.normal(static_cast<Index>(pair));
    result.r.segment(first, own) = laws_[pair].topLeftCorner(own, own) * y.segment(first, own);
  }
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
  const auto negative = (factors_->own.matrixLU().diagonal().array() < 0).count();
  return factors_->rows.empty() || factors_->own.permutationP().determinant() * (negative % 2 == 0 ? 1 : -1) > 0 ? 1
                                                                                                                 : -1;
}

double StatusSystem::reciprocal_condition() const
{
  return factors_->rows.empty() ? 1 : pivot_ratio(factors_->own);
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
  std::shared_ptr<const StatusFactors>& factors;
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
    constexpr int patience = 3;   // steps that do not halve the residual
    constexpr double slow = 0.1;  // fall of the merit by a step with near laws
    constexpr double near = 0.05; // of J
    double least = std::numeric_limits<double>::infinity();
    for (int idle = 0; !ends_at(at, tight); ++best.iterations)
    {
      idle = best.residual < 0.5 * least ? 0 : idle + 1;
      if (idle == patience) return;
      if (idle == 0) least = best.residual;
      const VectorXd now = rest(at, 0, at.w);
      const StickSlipState change = StatusSystem(of, friction, at, {}, near, factors).change(now, {});
      const double before = merit(at, 0, now), part = part_of(at, change, 0, now, 0x1p-8);
      at = beyond(at, part, change);
      if (merit(at, 0, (1 - part) * now) > slow * before) factors.reset();
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
    const StickSlipState change = StatusSystem(of, friction, at, soft, 0, factors).change(now, soft);
    const double part = part_of(at, change, soft.force, now, least_part);
    if (part == least_part) return; // rounding
    at = beyond(at, part, change);
  }
}

} // namespace

StickSlipSolution solve_stick_slip(const StickSlipOperator& of, const StickSlipFriction& friction, const VectorXd& q,
                                   const StickSlipState& guess, std::shared_ptr<const StatusFactors>& factors)
{
  Increment increment{of, friction, q, factors, {guess, 0, std::numeric_limits<double>::infinity(), false}};
  increment.by_statuses(guess);
  if (increment.best.converged || of.motion(q) == 0) return increment.best;
  increment.by_smoothing(guess);
  increment.by_statuses(StickSlipState(increment.best.state));
  return increment.best;
}

} // namespace squeal
