#pragma once
/// The verdict on a closed orbit: its multipliers, and what a motion beside it does (src/README.md, section 6.9).
/// Functions that take a problem are collective.
#include "squeal/base/outcome.hpp"
#include "squeal/shooting/multipliers.hpp"

namespace squeal
{

/// Whether motions settle on an orbit, and how that is known.
struct Verdict
{
  FloquetAnalysis floquet{};
  bool doubted = false;   // the tangent says that it repels; a motion beside it neither leaves nor comes nearer
  bool cut_short = false; // the run was asked to end meanwhile

  bool repels() const { return floquet.multipliers.stability == Stability::unstable; }
};

/// Seeks the multipliers of an orbit, and holds them against motions beside it. Where the run is asked to end
/// meanwhile, the verdict is cut short. Error: as of the flow.
Verdict judge(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log, const Orbit& orbit);

/// An orbit that repels is no answer; with other unstable modes the motion need not be periodic at all. Not collective.
void refuse_repelling(const Verdict& verdict, std::size_t other_unstable, Outcome& outcome);

} // namespace squeal
