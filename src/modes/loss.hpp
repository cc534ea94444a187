#pragma once
/// Modes of structures with loss factors (src/README.md, section 3.11): those of complex stiffness,
///     (lambda^2 M + lambda C_0 + K + i K_loss) y = 0,   Im(lambda) > 0.
///
/// The problem on the span of all pairs without losses shows where pairs with losses lie. Slices of |lambda| are solved
/// on subspaces that residuals correct.
#include "squeal/algebra/pencil_factor.hpp"
#include "squeal/modes/quadratic.hpp"

namespace squeal
{

/// Replaces the pairs of a problem without loss factors, whose C is C_0, by those with them; real ones stay. `K_loss`:
/// in the rows and columns of the problem. Sets outcome.residual. Collective.
void correct_loss(QuadraticSolution& solution, const QuadraticProblem& problem, Mat K_loss,
                  const PencilOptions& options);

} // namespace squeal
