#pragma once
/// Events between two points of a branch, and where they happen (src/README.md, section 9.3).
#include "corrector.hpp"

#include <array>

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

/// The events from one point to the next one but the folds and those of multipliers.
std::vector<BranchEvent> events_between(BranchCorrector& corrector, const ExaminedOrbit& from, const ExaminedOrbit& to);

/// How many multipliers of a kind are beyond the unit circle, and the last orbit of which that is certain.
struct KnownBeyond
{
  BranchEventKind kind;
  int count = 0;
  std::size_t place = 0;
};

/// What is known at the start of a side, of each kind of event.
std::array<KnownBeyond, 2> known_beyond(const Multipliers& start);

/// The event by which the last of a side's orbits has another number of multipliers beyond the unit circle than is
/// known, whatever their bars: where |m| = 1, by what the bars leave of it. None where the number may be the same, or
/// where multipliers only met on the real axis.
std::optional<BranchEvent> crossing_among(BranchCorrector& corrector, const std::vector<ExaminedOrbit>& orbits,
                                          KnownBeyond& known);

/// The turning point of the parameter near the second of three points in succession; none if it does not turn.
std::optional<BranchEvent> fold_among(BranchCorrector& corrector, const std::array<const ExaminedOrbit*, 3>& points);

} // namespace squeal
