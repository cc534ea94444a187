#pragma once
/// All pairs of a band of the quadratic problem with friction, and their count (src/README.md, sections 3.8 and 3.9).
///
/// A slice of |lambda| starts from the undamped problem with friction, K y = theta M y, real and unsymmetric. One
/// factor of K - tau M at the slice's middle gives the invariant subspace about it (shift_invert.hpp), which then holds
/// all pairs where C = alpha M + beta K. Other damping is corrected by residuals with the same factor (passes.hpp).
/// Problems up to ModesOptions::dense_limit are solved whole. Functions are collective. Error: memory runs out.
#include "squeal/modes/modes.hpp"
#include "squeal/modes/quadratic.hpp"

namespace squeal
{

/// The problem with friction and the symmetric one without. All are borrowed, of one layout.
struct PairProblem
{
  const QuadraticProblem& sliding; // Y'.Z
  Mat K_loss = nullptr;            // of loss factors, Y'.Z; null: none
  Mat M_z = nullptr, K_z = nullptr;
};

/// Pairs, and what counts them.
struct PairSearch
{
  QuadraticSolution solution;   // of the problem with losses
  double top = 0;               // [rad/s] everything below is here
  std::vector<double> moduli{}; // |lambda| of the pairs without losses [rad/s]
  std::vector<double> omega{};  // of the real modes [rad/s], ascending; empty where the inertia agrees
  int expected = 0;             // real modes below the top by that inertia
};

/// All pairs below the band [Hz] and, for the count, a little beyond. By SLEPc where `method` says so.
PairSearch search_pairs(const PairProblem& problem, ModesMethod method, double band, const ModesOptions& options);

/// Pairs remain pairs when friction and damping move them. As mu grows from zero, their number in a disc |lambda| <
/// omega changes only where one crosses its edge. So the pairs below an edge are as many as the real modes. The edge is
/// the top or, where they disagree, the highest one between neighbouring pairs from `least` [rad/s] on below which they
/// agree. Real modes below `floor` [rad/s] are motions of a free body. Not collective.
ModeCount count_pairs(const PairSearch& search, double floor, double least);

} // namespace squeal
