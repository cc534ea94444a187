#pragma once
/// The full-space finish of a shooting (src/README.md, section 6.8), by the solvers that -cycle_finish names.
#include "squeal/shooting/options.hpp"
#include "squeal/shooting/orbit.hpp"

namespace squeal
{

/// The multisecant iteration; where it gives up, ten more free periods and the iteration once again; where that gives
/// up, Newton-Krylov.
StageResult shoot_in_full_space(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                Orbit start);

} // namespace squeal
