#pragma once
/// Modes of structures with loss factors (src/README.md, section 3.11). Each mode j has the viscous equivalent of the
/// complex stiffness K + i K_loss at its own frequency,
///     (lambda^2 M + lambda (C_0 + K_loss/omega_j) + K) y = 0,   omega_j = Im(lambda),
/// found by fixed point, and its distance to the complex problem (lambda^2 M + lambda C_0 + K + i K_loss) y = 0. Losses
/// about 1 and above, or beside strong viscous damping, have no such equivalent: the mode is then the complex
/// problem's.
///
/// Groups of neighbouring pairs are solved on the subspace of their vectors. Residuals of both problems join it as
/// (K - tau M)^-1 r until all are small.
#include "squeal/algebra/pencil_factor.hpp"
#include "squeal/modes/quadratic.hpp"

namespace squeal
{

/// What a mode's loss is, 0 for a real one.
struct ModeLoss
{
  std::complex<double> factor; // of K_loss in the mode's problem: lambda/omega_j, or i of the complex one
  double error = 0;            // |lambda - lambda of the complex problem|/|lambda|; NaN where lambda is of that one
};

/// Replaces the pairs of a problem without loss factors, whose C is C_0, by those of their own frequency; real ones
/// stay. `K_loss`: in the rows and columns of the problem. Returns the loss of each, in the order of the pairs. Sets
/// outcome.residual. Collective.
std::vector<ModeLoss> correct_loss(QuadraticSolution& solution, const QuadraticProblem& problem, Mat K_loss,
                                   const PencilOptions& options);

} // namespace squeal
