#pragma once
/// The motions that many starts lead to (src/README.md, section 9.5). Starts are all unstable modes, their pairs, and
/// random sums of modes. They are integrated together until their energies have settled.
///
/// Caveat: motions are distinguished by mean energy and frequency alone, and one that few starts lead to may be missed.
#include "squeal/attractors/reached.hpp"
#include "squeal/base/words.hpp"
#include "squeal/transient/transient.hpp"

namespace squeal
{

/// outcome: "completed"; "not converged" where the energy of some motion still had a trend; "refused" where a step may
/// have several solutions; "skipped"; "off".
struct Attractors
{
  Outcome outcome;
  std::vector<std::string> starts;    // what each is made of
  std::vector<ReachedMotion> motions; // the one that most starts lead to first
  long periods = 0;                   // of the followed mode, that each was integrated over
};

/// The brake about its equilibrium, and the starts that the scene asks for.
struct AttractorProblem
{
  SlidingEquilibrium sliding;
  const std::vector<ComplexMode>& modes; // all in the band
  UnstableModes unstable;
  const CycleSettings& settings; // its starts, its steps a period and theta
  const StepOptions& step;
  bool from_small = false; // whether a small motion of the mode that grows fastest starts as well
};

/// Integrates the motions of all starts together until their energies have settled, for at most 400
/// periods of the followed mode. Bars hold what half as many steps a period change. Collective. Where the run is asked
/// to end it throws Interrupted.
Attractors find_attractors(const AttractorProblem& problem);

} // namespace squeal
