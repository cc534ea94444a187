#pragma once
/// The starts from which motions are sought.
#include "squeal/attractors/attractors.hpp"

namespace squeal
{

struct NamedStart
{
  std::string name;
  State state;
};

/// Each unstable mode at its estimate, pairs of them, and random sums of modes up to the number asked for; behind them
/// the small motion, where it is asked for.
std::vector<NamedStart> make_starts(const AttractorProblem& problem);

} // namespace squeal
