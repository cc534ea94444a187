#include "squeal/contact/stick_slip.hpp"

#include <algorithm>
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

/// A pair before a step of the iteration.
struct PairState
{
  Vector3d r, w;
  double mu;
  Eigen::Vector2d e; // of the drive; zero: it has none
  NaturalScale rho;
  double grazing; // [N] that no sign is read from

  double pressing() const { return r[0] - rho.normal * w[0]; }
  Eigen::Vector2d pulling() const { return r.tail<2>() - rho.tangential * w.tail<2>(); }

  ContactStatus status() const
  {
    if (pressing() < -grazing) return ContactStatus::open;
    const bool sticks = e.isZero(0) && mu > 0 && pulling().norm() <= mu * pressing();
    return sticks ? ContactStatus::stick : ContactStatus::slip;
  }

  /// The law's defect [N], r - proj(r - rho w) with the disc of the projected normal reaction.
  Vector3d defect() const
  {
    Vector3d result = r;
    if (pressing() <= 0) return result;
    result[0] = rho.normal * w[0];
    if (status() == ContactStatus::stick)
      result.tail<2>() = rho.tangential * w.tail<2>();
    else if (!e.isZero(0))
      result.tail<2>() -= mu * r[0] * e;
    else if (const double size = pulling().norm(); size > 0)
      result.tail<2>() -= mu * pressing() / size * pulling();
    return result;
  }
};

/// The forces that defects of each contact's pairs are compared with [N]: its largest reaction, or a small part of all
/// contacts' and of what slips would take, where a contact is about to open.
std::vector<double> scales_of(const StickSlipOperator& of, const StickSlipState& at)
{
  constexpr double small = 1e-4;
  double slip = 0;
  for (std::size_t pair = 0; pair < of.rho.size(); ++pair)
    slip = std::max(slip, entries(at.w, pair, of.directions).tail<2>().norm() / of.compliance);
  return largest_of_contacts(of.contact, of.rho.size(),
                             [&](std::size_t pair)
                             { return std::max(entries(at.r, pair, of.directions).norm(), small * slip); });
}

/// All pairs before a step of the iteration.
struct PairStates
{
  const StickSlipOperator& of;
  const StickSlipFriction& friction;
  const StickSlipState& at;
  std::vector<double> scale = scales_of(of, at);
  double grazing = rounding * *std::ranges::max_element(scale);

  double scale_of(std::size_t pair) const { return scale[static_cast<std::size_t>(of.contact[pair])]; }

  PairState operator[](std::size_t pair) const
  {
    const std::span<const double> e = TangentView<const double>(friction.e, of.directions).of(pair);
    return {entries(at.r, pair, of.directions),
            entries(at.w, pair, of.directions),
            friction.mu[pair],
            {e[0], e.size() > 1 ? e[1] : 0},
            of.rho[pair],
            grazing};
  }
};

VectorXd times_M(const StickSlipOperator& of, const VectorXd& r)
{
  return of.M.size() > 0 ? VectorXd(of.M * r) : r;
}

/// |N w - q - M r| over the part of reactions and motions in it.
double imbalance(const StickSlipOperator& of, const VectorXd& q, const StickSlipState& at)
{
  const double per_force = of.M.size() > 0 ? of.compliance : 1,
               of_motion = of.N.cwiseAbs().lazyProduct(at.w.cwiseAbs()).maxCoeff(),
               scale = std::max({q.lpNorm<Eigen::Infinity>(), of_motion, per_force * at.r.lpNorm<Eigen::Infinity>()});
  return scale > 0 ? (of.N * at.w - q - times_M(of, at.r)).lpNorm<Eigen::Infinity>() / scale : 0;
}

double sum_of_squares(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at)
{
  const PairStates states{of, friction, at};
  double sum = 0;
  for (std::size_t pair = 0; pair < of.rho.size(); ++pair) sum += states[pair].defect().squaredNorm();
  return sum;
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

double stick_slip_residual(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at)
{
  const PairStates states{of, friction, at};
  double worst = 0;
  for (std::size_t pair = 0; pair < of.rho.size(); ++pair)
    if (const double defect = states[pair].defect().norm(); defect > 0)
      worst = std::max(worst, states.scale_of(pair) > 0 ? defect / states.scale_of(pair)
                                                        : std::numeric_limits<double>::infinity());
  return worst;
}

namespace
{

/// The unknowns of a closed pair: r_n first; then the friction of a pair that sticks, or the slip of one that slips.
/// `force`: an unknown's unit.
LinearPairLaw closed_law(const PairState& state, double force, int directions)
{
  LinearPairLaw law;
  const double h = state.pressing();
  law.w[0] = -state.w[0];
  law.R(0, 0) = force;
  law.forces = 1;
  if (state.status() == ContactStatus::stick)
  {
    law.w.tail<2>() = -state.w.tail<2>();
    law.R(1, 1) = law.R(2, 2) = force;
    law.forces = 1 + directions;
    return law;
  }
  if (!state.e.isZero(0) || state.mu == 0)
  {
    law.r.tail<2>() = state.mu * state.r[0] * state.e - state.r.tail<2>();
    law.R.block<2, 1>(1, 0) = state.mu * force * state.e;
    law.W(1, 1) = law.W(2, 2) = 1;
    return law;
  }
  // dr_t - mu d dh - a (1 - d d')(dr_t - rho dw_t) = mu h d - r_t,  dh = dr_n + rho_n w_n,  a = mu h/|t|
  const Eigen::Vector2d t = state.pulling(), d = t / t.norm(), across(-d[1], d[0]);
  const double a = state.mu * h / t.norm(), size = (1 - a) * (1 - a) + a * a, rest = -across.dot(state.r.tail<2>());
  law.R.block<2, 1>(1, 0) = state.mu * force * d;
  law.r.tail<2>() =
      (state.mu * (h + state.rho.normal * state.w[0]) - d.dot(state.r.tail<2>())) * d + (1 - a) * rest / size * across;
  law.w.tail<2>() = a * rest / (state.rho.tangential * size) * across;
  law.W.block<2, 1>(1, 1) = directions == 1 ? Eigen::Vector2d(1, 0) : d; // no turn: the index keeps its sign
  law.W.block<2, 1>(1, 2) = (1 - a) * across;
  law.R.block<2, 1>(1, 2) = -a * state.rho.tangential * across;
  return law;
}

LinearPairLaw linear_law(const PairState& state, double force, int directions)
{
  if (state.status() != ContactStatus::open) return closed_law(state, force, directions);
  LinearPairLaw law;
  law.r = -state.r;
  law.W.setIdentity();
  return law;
}

} // namespace

StatusSystem::StatusSystem(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at)
    : of_(of)
{
  const PairRows<Index> rows(of.directions);
  const Index own = rows.per_pair();
  const bool whole = of.M.size() > 0;
  particular_ = {VectorXd::Zero(of.N.rows()), VectorXd::Zero(of.N.rows())};
  const PairStates states{of, friction, at};
  for (std::size_t pair = 0; pair < of.rho.size(); ++pair)
  {
    const PairState state = states[pair];
    statuses_.push_back(state.status());
    const LinearPairLaw& system = pairs_.emplace_back(linear_law(state, 1 / of.compliance, of.directions));
    const Index first = rows.normal(static_cast<Index>(pair));
    particular_.r.segment(first, own) = system.r.head(own);
    particular_.w.segment(first, own) = system.w.head(own);
    if (!whole && statuses_.back() == ContactStatus::stick) continue;
    unknown_.push_back(pair);
    for (Index k = 0; k < own; ++k) rows_.push_back(first + k);
  }
  const auto size = static_cast<Index>(rows_.size());
  matrix_.resize(size, size);
  for (std::size_t i = 0; i < unknown_.size(); ++i)
  {
    const LinearPairLaw& system = pairs_[unknown_[i]];
    const Index first = rows.normal(static_cast<Index>(unknown_[i])), to = rows.normal(static_cast<Index>(i));
    const auto of_pair = Eigen::seqN(first, own);
    auto columns = matrix_.middleCols(to, own);
    columns.noalias() = of.N(rows_, of_pair) * system.W.topLeftCorner(own, own);
    if (whole)
      columns.noalias() -= of.M(rows_, of_pair) * system.R.topLeftCorner(own, own);
    else
      columns.middleRows(to, own) -= system.R.topLeftCorner(own, own);
    for (Index k = 0; k < own; ++k) // a row in which neither side moves leaves its friction open: it stays
      if (columns.col(k).isZero(0)) columns(to + k, k) = -1;
  }
  if (size > 0) factors_.compute(matrix_);
}

StickSlipState StatusSystem::spread(const VectorXd& y) const
{
  StickSlipState result{VectorXd::Zero(of_.N.rows()), VectorXd::Zero(of_.N.rows())};
  const PairRows<Index> rows(of_.directions);
  const Index own = rows.per_pair();
  for (std::size_t i = 0; i < unknown_.size(); ++i)
  {
    const LinearPairLaw& system = pairs_[unknown_[i]];
    const Index first = rows.normal(static_cast<Index>(unknown_[i]));
    const auto of_pair = y.segment(rows.normal(static_cast<Index>(i)), own);
    result.r.segment(first, own) = system.R.topLeftCorner(own, own) * of_pair;
    result.w.segment(first, own) = system.W.topLeftCorner(own, own) * of_pair;
  }
  return result;
}

VectorXd StatusSystem::solution(const VectorXd& rhs) const
{
  if (rhs.size() == 0) return rhs;
  if (reciprocal_condition() > 1e-13) return factors_.solve(rhs);
  // rows of pairs that depend on each other: the shortest solution shares what they carry evenly
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> orthogonal;
  orthogonal.setThreshold(1e-12);
  orthogonal.compute(matrix_);
  return orthogonal.solve(rhs);
}

StickSlipState StatusSystem::response(const VectorXd& rhs) const
{
  StickSlipState result = spread(solution(rhs(rows_)));
  if (of_.M.size() > 0) return result;
  const VectorXd forces = of_.N * result.w - rhs;
  const PairRows<Index> rows(of_.directions);
  for (std::size_t pair = 0; pair < pairs_.size(); ++pair)
    if (statuses_[pair] == ContactStatus::stick)
      result.r.segment(rows.normal(static_cast<Index>(pair)), rows.per_pair()) =
          forces.segment(rows.normal(static_cast<Index>(pair)), rows.per_pair());
  return result;
}

StickSlipState StatusSystem::change(const VectorXd& rhs) const
{
  StickSlipState result = response(rhs - of_.N * particular_.w + times_M(of_, particular_.r));
  result.r += particular_.r;
  result.w += particular_.w;
  return result;
}

int StatusSystem::index() const
{
  int forces = 0;
  if (unknown_.empty()) return 1;
  for (const std::size_t pair : unknown_) forces += pairs_[pair].forces;
  const auto negative = (factors_.matrixLU().diagonal().array() < 0).count();
  const double sign = factors_.permutationP().determinant() * ((forces + negative) % 2 == 0 ? 1 : -1);
  return sign > 0 ? 1 : -1;
}

double StatusSystem::reciprocal_condition() const
{
  return unknown_.empty() ? 1 : pivot_ratio(factors_);
}

namespace
{

/// The part of a change, a power of a half, that leaves the least defect of the laws, or the first that lowers it. A
/// whole change that raises it may send a body that its statuses leave free any distance away.
StickSlipState after_change(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at,
                            const StickSlipState& change)
{
  constexpr double least = 0x1p-8;
  const double merit = sum_of_squares(of, friction, at);
  StickSlipState best;
  double lowest = std::numeric_limits<double>::infinity();
  for (double part = 1; part >= least; part /= 2)
  {
    StickSlipState next{at.r + part * change.r, at.w + part * change.w};
    const double defect = sum_of_squares(of, friction, next);
    if (!(defect < lowest)) continue;
    lowest = defect;
    best = std::move(next);
    if (lowest < merit * (1 - 1e-4 * part)) break;
  }
  return std::isfinite(lowest) ? best : StickSlipState{at.r + change.r, at.w + change.w};
}

} // namespace

StickSlipSolution solve_stick_slip(const StickSlipOperator& of, const StickSlipFriction& friction, const VectorXd& q,
                                   StickSlipState guess)
{
  constexpr int most = 200, patience = 40; // iterations in all, and without a smaller defect of the laws
  StickSlipSolution best{guess, 0, std::numeric_limits<double>::infinity()};
  StickSlipState at = std::move(guess);
  double least = std::numeric_limits<double>::infinity();
  int last_gain = 0;
  for (int iteration = 0; iteration <= most && iteration - last_gain <= patience; ++iteration)
  {
    const double residual = std::max(stick_slip_residual(of, friction, at), imbalance(of, q, at));
    if (residual < best.residual) best = {at, iteration, residual};
    if (!std::isfinite(at.r.sum() + at.w.sum()) || residual <= tight) break;
    const StatusSystem system(of, friction, at);
    const StickSlipState change = system.change(q + times_M(of, at.r) - of.N * at.w);
    // the first change balances the load: a guess that fulfils the laws, as that of no forces does, is no measure
    at = iteration == 0 ? StickSlipState{at.r + change.r, at.w + change.w} : after_change(of, friction, at, change);
    if (const double defect = sum_of_squares(of, friction, at); defect < least) least = defect, last_gain = iteration;
  }
  best.converged = best.residual <= good;
  return best;
}

} // namespace squeal
