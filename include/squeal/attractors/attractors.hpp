#pragma once
/// The attractors of motions (src/README.md, section 9.5): means of a window, their trend, and which motions are the
/// same. Arithmetic on lists that every rank has; no function throws.
#include "squeal/base/words.hpp"
#include "squeal/settled/motion.hpp"
#include "squeal/transient/transient.hpp"

#include <array>
#include <cstddef>
#include <vector>

namespace squeal
{

/// The kind of a motion at its end.
enum class ReachedKind
{
  rest,      // the motion decayed
  steady,    // the mean energy is known to half a percent
  varying,   // it is not, but it is stationary, and its spread does not fall to a half: no cycle attracts there
  unsettled, // the energy is not stationary, or its spread falls
};

template <> inline constexpr std::array words_of<ReachedKind> = {"rest", "steady", "varying", "unsettled"};

/// A motion that starts lead to.
struct ReachedMotion
{
  ReachedKind kind = ReachedKind::unsettled;
  MeanValue energy;                // [J] mean fluctuating energy
  MeanValue frequency;             // [Hz] of the mode's coordinate that moves most; 0 at rest
  std::vector<std::size_t> starts; // numbers of the starts that lead to it
};

/// [Hz] Of upward zero crossings [s], from their second half, with a bar; zero where they are too few.
MeanValue frequency_of(const std::vector<double>& crossings);

/// The attractor of one motion, from the mean energies of its periods and the upward zero crossings [s] of a
/// coordinate. An energy below `rest` is that of a motion at rest. Fewer than 20 periods are unsettled: the energy is
/// the mean of their second half, its bar their range.
ReachedMotion reached_by(const std::vector<double>& energies, const std::vector<double>& crossings, double rest);

/// Whether energies and frequencies agree within their bars, or within a percent and a thousandth.
bool agree(const ReachedMotion& a, const ReachedMotion& b);

/// Whether the motion is the cycle of this energy [J] and frequency [Hz]: a coordinate crosses zero a whole number of
/// times a period.
bool is_cycle(const ReachedMotion& motion, const MeanValue& energy, const MeanValue& frequency);

/// Joins motions of one kind that agree. Those that most starts lead to come first.
std::vector<ReachedMotion> joined(std::vector<ReachedMotion> motions);

// The motions that many starts lead to (src/README.md, section 9.5). Starts are all unstable modes, their pairs, and
// random sums of modes. They are integrated together until their energies have settled.
//
// Caveat: motions are distinguished by mean energy and frequency alone, and one that few starts lead to may be missed.

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
