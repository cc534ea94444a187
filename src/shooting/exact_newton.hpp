#pragma once
/// Newton on a small system with the whole matrix of the exact tangent (src/README.md, section 6.8). Each iteration
/// integrates one period, and all its columns follow together along that period.
///
/// Caveat: the period map is only piecewise smooth, and there is no globalisation. The step is clamped, and the stage
/// gives up where a few iterations bring no progress.
#include "squeal/shooting/options.hpp"
#include "squeal/shooting/orbit.hpp"

namespace squeal
{

/// Whether the flow has an exact tangent and is small enough for its whole matrix.
bool has_small_tangent(const OrbitProblem& problem);

StageResult shoot_by_exact_newton(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                  const Orbit& start);

} // namespace squeal
