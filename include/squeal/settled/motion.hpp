#pragma once
/// What a motion settles on where no cycle attracts: its statistics and its kind, on any flow with a tangent
/// (src/README.md, section 7.10).
#include "squeal/base/petsc.hpp"
#include "squeal/base/words.hpp"
#include "squeal/settled/exponents.hpp"
#include "squeal/settled/spectrum.hpp"

#include <array>
#include <string>

namespace squeal
{

/// What attracts a motion.
enum class MotionKind
{
  undecided,
  periodic,       // a cycle attracts, which may close after several periods
  quasi_periodic, // a torus attracts
  irregular,      // small differences grow
};

template <> inline constexpr std::array words_of<MotionKind> = {"undecided", "periodic", "quasi-periodic", "irregular"};

/// Options -settled_...
struct SettledOptions
{
  PetscInt periods = 0;   // windows integrated at most; 0: 2048, and 512 where they are dear
  PetscInt exponents = 4; // Lyapunov exponents
  PetscInt shapes = 100;  // at most, that the motion is kept on
};

/// The kind of a motion, or what it is undecided between.
struct MotionVerdict
{
  MotionKind kind = MotionKind::undecided;
  std::string between, would_decide; // of an undecided one, in words
};

/// A motion as it is seen at equal steps.
struct MotionSeries
{
  std::vector<std::vector<double>> averaged; // whose means over periods count; by the first stationarity is judged
  std::vector<std::vector<double>> moving;   // whose swings within periods count; the largest has the spectrum
  std::vector<double> beside; // its spectrum where nothing moves; shows a second frequency else, or empty
};

/// A motion that is integrated window by window: its flow's tangent belongs to the window before.
struct ObservedMotion
{
  double window;                            // [s]
  std::function<double(Vec state)> advance; // in place, by one window; the mean there of what is averaged first
  std::function<MotionSeries()> series;     // from the start
};

/// A motion, what is measured on it and its kind. Its period is that of its strongest line, or the multiple after which
/// it closes; a window, which may be of any length, where fewer than 16 of these were seen.
struct ExaminedMotion
{
  std::size_t windows = 0;                   // integrated
  double period = 0;                         // [s]
  std::vector<std::vector<double>> channels; // [channel][period], from the start: means, then swings
  int followed = -1;                         // which of what moves the spectrum is of; -1: what is beside it
  std::size_t discarded = 0;                 // periods before the motion was stationary; all of them if it never was
  std::vector<MeanValue> means;              // of each channel, from the periods after those
  std::vector<MeanValue> exponents;          // per period, largest first
  Spectrum spectrum;                         // of the same periods
  BaseFrequencies base;
  MotionVerdict verdict;

  std::size_t periods() const { return channels.empty() ? 0 : channels.front().size(); }
};

/// The kind that exponents, energies of the periods and base frequencies show.
MotionVerdict judge_motion(const std::vector<MeanValue>& exponents, std::span<const double> energies,
                           const BaseFrequencies& base);

/// Integrates 128 windows, and twice as many until the kind is decided or the options' number is reached. The state
/// goes along. Collective.
ExaminedMotion examine_motion(const Flow& flow, const ObservedMotion& observed, Vec state,
                              const SettledOptions& options);

} // namespace squeal
