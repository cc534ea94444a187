#include "exact_newton.hpp"

#include "squeal/base/constants.hpp"
#include "whole_matrix.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A correction of the orbit.
struct Correction
{
  Owned<Vec> state;
  double period = 0; // [s]
};

/// The solution of [dPhi/dx - I, d; f', 0] (dx, dT) = (-F, 0), clamped. Its period is NaN where the matrix is not
/// finite.
Correction newton_step(const OrbitProblem& problem, double clamp, const Orbit& orbit)
{
  const Flow& flow = problem.flow;
  flow.record_period(orbit.period, orbit.state, {});
  const MatrixXd M = whole_matrix(orbit, [&](std::span<const Owned<Vec>> states)
                                  { flow.apply_tangent(std::vector<Vec>(states.begin(), states.end())); });
  const MatrixXd Q = coordinates_with_mass(flow);
  const Index n = Q.cols(), all = M.rows();
  const double scale = orbit.period / (2 * PETSC_PI), speed = energy_norm(flow, orbit.rate);
  const Owned<Vec> image = zeros_like(orbit.rate);
  energy_image(flow, orbit.rate, image);
  MatrixXd J = MatrixXd::Zero(n + 1, n + 1);
  J.topLeftCorner(n, n) = Q.transpose() * M * Q - MatrixXd::Identity(n, n);
  const VectorXd rate = Q.transpose() * coordinates_of(orbit.rate, orbit.period);
  const double rate_norm = std::max(rate.norm(), 1e-300); // a motion of any size has a column of size 1
  J.col(n).head(n) = rate / rate_norm;
  VectorXd along = coordinates_of(image, orbit.period) / speed;
  along.tail(all / 2) /= scale * scale; // the image's velocities are forces: their coordinates are over it once more
  J.row(n).head(n) = (Q.transpose() * along).transpose();
  VectorXd rhs = VectorXd::Zero(n + 1);
  rhs.head(n) = -Q.transpose() * coordinates_of(orbit.defect, orbit.period);
  J.row(n) /= std::max(J.row(n).norm(), 1e-300);
  if (!J.allFinite() || !rhs.allFinite()) return {zeros_like(orbit.rate), std::nan("")}; // Eigen would never end
  const VectorXd step = J.completeOrthogonalDecomposition().solve(rhs);
  Correction correction{state_at(Q * step.head(n), orbit), step(n) / rate_norm};
  const double length = std::max(energy_norm(flow, correction.state), std::abs(correction.period) * speed);
  const double factor = std::min(1., clamp * orbit.fluctuation / length);
  check(VecScale(correction.state, factor));
  correction.period *= factor;
  return correction;
}

} // namespace

bool has_small_tangent(const OrbitProblem& problem)
{
  return problem.flow.apply_tangent && dofs_of(problem.equilibrium) <= small_model;
}

StageResult shoot_by_exact_newton(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                  const Orbit& start)
{
  constexpr int patience = 5; // iterations without progress: near a solution each one is far better than the last
  StageResult best{copy_of(start), StageEnding::stalled};
  Orbit orbit = copy_of(start);
  for (int since_best = 0; best.orbit.residual > problem.tolerance;)
  {
    if (since_best >= patience || log.convergence.periods >= options.max_periods) return best;
    const Correction step = newton_step(problem, options.clamp, orbit);
    if (!admissible_period(problem, orbit.period + step.period))
    {
      best.ending = StageEnding::period_left_range;
      return best;
    }
    const Owned<Vec> moved = copy_of(orbit.state);
    check(VecAXPY(moved, 1, step.state));
    orbit = evaluate(problem, log, moved, orbit.period + step.period);
    ++log.convergence.iterations;
    record_full(log, ShootingStage::exact_newton, orbit);
    if (collapsing(problem, orbit) || !std::isfinite(orbit.residual))
    {
      best.ending = StageEnding::collapsed;
      return best;
    }
    ++since_best;
    if (orbit.residual >= best.orbit.residual) continue;
    best.orbit = copy_of(orbit);
    since_best = 0;
  }
  best.ending = StageEnding::converged;
  return best;
}

} // namespace squeal
