#pragma once
/// The stages of a run, in the order in which they run, and their names.
#include "squeal/base/words.hpp"

#include <array>

namespace squeal
{

/// A stage of a run.
enum class Stage
{
  model,
  equilibrium,
  modes,
  estimate,
  response,
  transient,
  cycle,
  settled,
  attractors,
  branch,
  sensitivity,
  sweep,
  robustness,
};

template <> inline constexpr std::array words_of<Stage> = {
    "model",   "equilibrium", "modes",  "estimate",    "response", "transient", "cycle",
    "settled", "attractors",  "branch", "sensitivity", "sweep",    "robustness"};

} // namespace squeal
