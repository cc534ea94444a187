#pragma once
/// Integration without correction (src/README.md, section 6.3): the flow itself brings the motion nearer to an orbit
/// that attracts.
#include "squeal/shooting/orbit.hpp"

namespace squeal
{

/// `count` periods from the state, then the evaluation of the end with the period of the best recurrence.
Orbit integrate_free_periods(const OrbitProblem& problem, ConvergenceLog& log, Vec state, double period, int count);

} // namespace squeal
