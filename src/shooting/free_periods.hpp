#pragma once
/// Integration without correction (src/README.md, section 6.3): the flow itself brings the motion nearer to an orbit
/// that attracts.
#include "squeal/shooting/orbit.hpp"

namespace squeal
{

/// The residual without its part along the flow: how far the motion misses its start at the nearest recurrence.
double return_residual(const OrbitProblem& problem, const Orbit& orbit);

/// When free integration ends.
struct FreeIntegration
{
  int periods = 0;          // at most
  double near_periodic = 0; // return residual at which it ends before; 0: never
  int at_most = 0;          // periods where an offset still slips one way
};

/// Free periods from the state, then the evaluation of the end with the period of the best recurrence.
Orbit integrate_free_periods(const OrbitProblem& problem, ConvergenceLog& log, Vec state, double period,
                             const FreeIntegration& asked);

} // namespace squeal
