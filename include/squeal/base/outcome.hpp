#pragma once
/// How a stage of the chain ended: a result that does not converge is reported, never thrown.
#include "squeal/base/words.hpp"

#include <algorithm>
#include <array>
#include <string>

namespace squeal
{

/// All ways in which stages end.
enum class OutcomeKind
{
  skipped, // a stage before it did not give what it needs
  off,     // the scene does not ask for it
  refused, // its settings would give misleading numbers
  converged,
  completed,
  balance,
  no_balance,
  not_converged,
  no_equilibrium,
  collapsed_to_equilibrium,
  not_periodic,
  unstable_cycle,
  settled,     // no cycle attracts: the settled motion is the answer
  interrupted, // asked to end: its results so far
};

template <> inline constexpr std::array words_of<OutcomeKind> = {"skipped",        "off",
                                                                 "refused",        "converged",
                                                                 "completed",      "balance",
                                                                 "no balance",     "not converged",
                                                                 "no equilibrium", "collapsed to equilibrium",
                                                                 "not periodic",   "unstable cycle",
                                                                 "settled",        "interrupted"};

/// Which kinds a stage can end in, and what `residual` measures, stands in the header of its result.
struct Outcome
{
  OutcomeKind kind = OutcomeKind::skipped;
  std::string reason; // one sentence where the word alone is not enough
  int iterations = 0;
  double residual = 0;
};

/// Whether the stage has results: it was neither switched off nor skipped.
inline bool has_run(const Outcome& outcome)
{
  return outcome.kind != OutcomeKind::off && outcome.kind != OutcomeKind::skipped;
}

/// Whether the stage gave what it promises. A stage that did not run has not failed: the one it waited for did.
inline bool succeeded(const Outcome& outcome)
{
  using enum OutcomeKind;
  constexpr std::array good = {skipped, off, converged, completed, balance, no_balance, settled};
  return std::ranges::find(good, outcome.kind) != good.end();
}

} // namespace squeal
