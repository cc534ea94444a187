#include "pair_states.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <Eigen/Dense>
#include <limits>

namespace squeal
{

namespace
{

constexpr double tight = 1e-12, good = 1e-9; // of the residual: where iterations end, and what counts as solved

/// |N w - q - M r| over the part of load and reactions in it. Motions are no measure: bodies that nothing holds go far.
double imbalance(const StickSlipOperator& of, const VectorXd& q, const StickSlipState& at)
{
  const double scale = std::max(q.lpNorm<Eigen::Infinity>(), of.compliance * at.r.lpNorm<Eigen::Infinity>());
  return scale > 0 ? (of.N * at.w - q - of.M * at.r).lpNorm<Eigen::Infinity>() / scale : 0;
}

} // namespace

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
    return q - of.N * at.w + of.M * (at.r - spring * (at.w - from));
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
    return PairStates{of, friction, at, smooth}.defects().squaredNorm() + (lacking / of.compliance).squaredNorm();
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
  const double first = q.lpNorm<Eigen::Infinity>() / of.compliance, pairs = static_cast<double>(of.rho.size());
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
  if (increment.best.converged || q.isZero(0)) return increment.best;
  increment.by_smoothing(guess);
  increment.by_statuses(StickSlipState(increment.best.state));
  return increment.best;
}

} // namespace squeal
