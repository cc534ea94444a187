#pragma once
/// Modes of structures with loss factors (src/README.md, section 3.11): each mode j has the viscous equivalent of the
/// complex stiffness K + i K_loss at its own frequency,
///     (lambda^2 M + lambda (C_0 + K_loss/omega_j) + K) y = 0,   omega_j = Im(lambda),
/// found by fixed point, and its distance to the complex problem (lambda^2 M + lambda C_0 + K + i K_loss) y = 0.
///
/// Groups of neighbouring pairs are solved on the subspace of their vectors. Residuals of both problems join it as
/// (K - tau M)^-1 r until all are small.
#include "squeal/algebra/pencil_factor.hpp"
#include "squeal/modes/quadratic.hpp"

namespace squeal
{

struct LossProblem
{
  const QuadraticProblem& problem; // whose C holds K_loss/omega
  Mat K_loss = nullptr;            // in the rows and columns of the problem
  double omega = 0;                // [rad/s]
};

/// Replaces the pairs of the problem, except real ones, by those of their own frequency. Returns the distance of each
/// to the complex problem over |lambda|, in the order of the pairs. Sets outcome.residual. Collective.
std::vector<double> correct_loss(QuadraticSolution& solution, const LossProblem& loss, const PencilOptions& options);

} // namespace squeal
