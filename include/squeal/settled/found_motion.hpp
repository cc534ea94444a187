#pragma once
/// The motion that was found from a point, and how it was sought.
#include "squeal/cycle/fidelity.hpp"
#include "squeal/settled/settled_motion.hpp"

namespace squeal
{

/// A state that a search starts from in place of the modes'.
struct GivenStart
{
  State state;
  double period = 0; // [s] of the cycle that it is nearly; 0: of none that is known
  int rounds = 1;    // as many as the period may be of the cycle
};

/// One attempt to find what vibrates.
struct Attempt
{
  std::string name;
  int steps_per_period = 0; // with which it began
  Outcome outcome;          // why it ended
};

/// The mode that the search for a cycle follows.
struct FollowedMode
{
  std::size_t index = 0;            // among the modes
  std::optional<Estimate> estimate; // where a given start chose it
};

/// Complete once it is returned; no stage changes it.
struct Motion
{
  LimitCycle cycle;
  Fidelity fidelity;     // of the cycle: the model that it was found on, and its errors
  SettledMotion settled; // where no cycle attracts
  FollowedMode followed;
  std::vector<Attempt> attempts; // in order
};

} // namespace squeal
