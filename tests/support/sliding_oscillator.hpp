#pragma once
/// The unilateral oscillator in steady sliding, its equilibrium solved by hand.
#include "small_models.hpp"
#include "squeal/equilibrium/equilibrium.hpp"

namespace squeal::test
{

/// Closed pair: y1 = y2 = y, r_n = -1.2 y, r_t = mu r_n:  1.1 x - 0.1 y = mu r_n,  -0.1 x + 0.5 y = r_n - 1.
inline Equilibrium sliding_equilibrium(const SmallModel& oscillator)
{
  const double mu = oscillator.interface.friction.common.coefficient;
  const double y = -1 / (1.7 - 0.1 * (0.1 - 1.2 * mu) / 1.1), x = (0.1 - 1.2 * mu) * y / 1.1, r = -1.2 * y;
  Equilibrium equilibrium;
  equilibrium.outcome.kind = OutcomeKind::converged;
  equilibrium.u = vector_like(oscillator.structure.K, {x, y, y});
  equilibrium.reactions = {r, mu * r};
  equilibrium.closed = {1};
  return equilibrium;
}

} // namespace squeal::test
