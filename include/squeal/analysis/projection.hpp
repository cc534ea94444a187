#pragma once
/// The quadratic eigenproblem on a small subspace, corrected by its own residuals.
///
/// On an orthonormal V, V'(lambda^2 M + lambda C + K) V a = 0 is small and dense. What V, the first real modes, lacks
/// shows in the residual r of each y = V a; its static answer K_s^-1 r, K_s the symmetric stiffness without friction,
/// joins V, and so on for some passes (Brizard, Chiello, Sinou, Lorang 2011). Only the pairs of largest growth
/// (Re/|lambda|) in the band are corrected: those decide. Caveat: an unstable pair that the first basis shows as well
/// damped may be left out; judge by the full problem.
#include "squeal/analysis/complex_block.hpp"
#include "squeal/analysis/quadratic.hpp"
#include "squeal/analysis/real_modes.hpp"

namespace squeal
{

/// The pairs (lambda, y), y brought to 2-norm 1, with their backward errors.
std::vector<Eigenpair> eigenpairs(const QuadraticProblem& problem, const std::vector<std::complex<double>>& lambda,
                                  const ComplexBlock& y);

struct ProjectionSettings
{
  double band = 0;    // [Hz]
  int passes = 0;     // of residual correction
  int candidates = 0; // pairs corrected in each pass
};

/// `M`, `K`: the symmetric problem of the real modes `basis`, in the unknowns y of `problem`. Backward errors are those
/// of `problem` itself.
QuadraticSolution solve_projected(const QuadraticProblem& problem, Mat M, Mat K, const RealModes& basis,
                                  const ProjectionSettings& settings);

} // namespace squeal
