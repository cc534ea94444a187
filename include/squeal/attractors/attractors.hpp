#pragma once
/// The motions that many starts lead to (src/README.md, section 9.4): all unstable modes, their pairs, and random sums
/// of modes, integrated together until their energies have settled.
///
/// Caveat: motions are distinguished by mean energy and frequency alone, and one that few starts lead to may be missed.
#include "squeal/base/options.hpp"
#include "squeal/settled/statistics.hpp"
#include "squeal/transient/transient.hpp"

namespace squeal
{

enum class ReachedKind
{
  rest,      // the motion decayed
  steady,    // the mean energy of every tenth of the window is within half a percent
  varying,   // it is not, but it has no trend: no cycle attracts there
  unsettled, // the energy still has a trend
};

inline constexpr std::array reached_words = {"rest", "steady", "varying", "unsettled"};

inline Words words_of(ReachedKind)
{
  return reached_words;
}

/// A motion that starts lead to.
struct ReachedMotion
{
  ReachedKind kind = ReachedKind::unsettled;
  MeanValue energy;                // [J] mean fluctuating energy
  MeanValue frequency;             // [Hz] of the mode's coordinate that moves most; 0 at rest
  std::vector<std::size_t> starts; // numbers of the starts that lead to it
};

/// outcome: "completed"; "not converged" where the energy of some motion still had a trend; "skipped"; "off".
struct Attractors
{
  Outcome outcome;
  std::vector<std::string> starts;    // what each is made of
  std::vector<ReachedMotion> motions; // the one that most starts lead to first
  long periods = 0;                   // of the followed mode, that each was integrated over
};

struct AttractorOptions
{
  PetscInt periods = 400; // at most
  PetscInt seed = 1;      // of the random starts
};

OptionList options_of(AttractorOptions& options);

struct AttractorProblem
{
  SlidingEquilibrium sliding;
  const std::vector<ComplexMode>& modes; // all in the band
  UnstableModes unstable;
  const CycleSettings& settings; // its starts, its steps a period and theta
  const StepOptions& step;
};

Attractors find_attractors(const AttractorProblem& problem, const AttractorOptions& options);

/// What one motion has settled on, from the energies of its periods and the upward zero crossings [s] of a coordinate.
/// `rest`: an energy below it is that of a motion at rest.
ReachedMotion reached_by(const std::vector<double>& energies, const std::vector<double>& crossings, double rest);

/// Joins motions of one kind whose energies and frequencies agree within their bars, or within a percent and a
/// thousandth. Those that most starts lead to come first.
std::vector<ReachedMotion> joined(std::vector<ReachedMotion> motions);

} // namespace squeal
