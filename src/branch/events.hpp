#pragma once
/// Events between two points of a branch, and where they happen (src/README.md, section 9.3).
#include "corrector.hpp"

namespace squeal
{

/// A closed orbit with its multipliers and what is measured on it.
struct ExaminedOrbit
{
  CorrectedOrbit corrected;
  Multipliers multipliers;
  PointMeasures measures;
};

/// Whether multipliers are asked for.
enum class Examined
{
  measures_alone,
  multipliers_too,
};

ExaminedOrbit examine(BranchCorrector& corrector, CorrectedOrbit corrected, Examined wanted);

/// The events from one point to the next one but the folds.
std::vector<BranchEvent> events_between(BranchCorrector& corrector, const ExaminedOrbit& from, const ExaminedOrbit& to);

/// The turning point of the parameter near the second of three points in succession; none if it does not turn.
std::optional<BranchEvent> fold_among(BranchCorrector& corrector, const std::array<const ExaminedOrbit*, 3>& points);

} // namespace squeal
