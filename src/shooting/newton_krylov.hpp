#pragma once
/// Full-space solution by Newton with a line search on the bordered system (src/README.md, section 6.8). GMRES works
/// on directional differences, preconditioned from the right (options -cycle_full_snes_..., -cycle_full_ksp_...).
///
/// The unknown is one Vec z = (omega sqrt(m) u, sqrt(m) v, speed T) with m the diagonal of M. Its plain norm, which
/// PETSc's solvers take, then stands for the energy norm. Convergence is decided in the energy norm itself.
#include "squeal/shooting/options.hpp"
#include "squeal/shooting/orbit.hpp"

namespace squeal
{

StageResult shoot_by_newton_krylov(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                   const Orbit& start);

/// Makes the options of its solver known to PETSc even where it never runs.
void declare_newton_krylov_options();

} // namespace squeal
