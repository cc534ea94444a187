#pragma once
/// The quadratic eigenproblem on a small subspace, corrected by its own residuals.
///
/// On an orthonormal V, V'(lambda^2 M + lambda C + K) V a = 0 is small and dense. What V lacks shows in the residual r
/// of each y = V a; an answer P^-1 r joins V, P a factor at hand, and so on for some passes.
#include "squeal/algebra/pencil_factor.hpp"
#include "squeal/modes/quadratic.hpp"
#include "squeal/modes/real_modes.hpp"

namespace squeal
{

/// Only the pairs of largest growth ratio, Re/|lambda|, are corrected, and of these only what is not below `enough`
/// yet, or, from a ratio of -1e-3 on, `sharp`: an eigenvalue's own error may be 1e4 times its backward error, and
/// growth is a small part of it.
struct Correction
{
  Window window;                // the pairs sought
  int passes = 0;               // at most
  int pairs = 0;                // corrected in each pass
  double enough = 0, sharp = 0; // backward errors
  double share = 0;             // of the residuals' largest direction: what is smaller waits for a later pass
};

/// `basis` spans the first V. Backward errors are those of `problem` itself; outcome.kind is the
/// caller's.
QuadraticSolution solve_on_subspace(const QuadraticProblem& problem, MultiVector basis, const PencilFactor& P,
                                    const Correction& correction);

struct ProjectionSettings
{
  double band = 0;    // [Hz]
  int passes = 0;     // of residual correction
  int candidates = 0; // pairs corrected in each pass
};

/// On the first real modes, corrected by the static answer of the symmetric stiffness without friction (Brizard,
/// Chiello, Sinou, Lorang 2011). Caveat: an unstable pair that the first basis shows as well damped may be left out;
/// judge by the full problem.
/// `M`, `K`: the symmetric problem of the real modes `basis`, in the unknowns y of `problem`.
QuadraticSolution solve_projected(const QuadraticProblem& problem, Mat M, Mat K, const RealModes& basis,
                                  const ProjectionSettings& settings);

} // namespace squeal
