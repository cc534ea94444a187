#pragma once
/// The full-space finish of a shooting (src/README.md, section 6.8), by the solvers that -cycle_finish names. Both are
/// collective. Error: as of the flow.
#include "squeal/shooting/options.hpp"
#include "squeal/shooting/orbit.hpp"

namespace squeal
{

/// One attempt by the multisecant iteration; its secants are exact where a whole tangent is cheap.
StageResult shoot_once(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log, Orbit start);

/// The same; where it gives up, ten free periods and one more attempt.
StageResult shoot_in_full_space(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                Orbit start);

/// An orbit gone round several times is a solution, too. Where the period over a prime factor of `rounds` nearly closes
/// the one found, that solution is returned, else `found`. Collective. Takes for each factor the steps of a period, and
/// of a search where it nearly closes.
StageResult prefer_fewer_rounds(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                int rounds, StageResult found);

} // namespace squeal
