#pragma once
/// What a motion settles on where no cycle attracts: its statistics and its kind, on any flow with a tangent
/// (src/README.md, section 7.10).
#include "squeal/base/options.hpp"
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
  PetscInt periods = 0;   // integrated at most; 0: 2048, and 512 where they are dear
  PetscInt exponents = 4; // Lyapunov exponents
  PetscInt shapes = 100;  // at most, that the motion is kept on
};

/// The kind of a motion, or what it is undecided between.
struct MotionVerdict
{
  MotionKind kind = MotionKind::undecided;
  std::string between, would_decide; // of an undecided one, in words
};

/// What is seen of one period.
struct PeriodSample
{
  std::vector<double> means;      // of each channel; the first is the energy that stationarity is judged by
  std::vector<double> coordinate; // of the spectrum, at equal steps
  std::vector<double> beside;     // another, where a second frequency is sought that the first does not see; or empty
};

/// Integrates one period in place, such that the flow's tangent then belongs to it.
using PeriodSampler = std::function<PeriodSample(Vec state)>;

/// A motion, what is measured on it and its kind.
struct ExaminedMotion
{
  std::vector<std::vector<double>> channels; // [channel][period], from the start
  std::vector<double> coordinate, beside;    // all samples
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

/// Integrates 128 periods, and twice as many until the kind is decided or the options' number is reached. The state
/// goes along. Collective.
ExaminedMotion examine_motion(const Flow& flow, const PeriodSampler& sampler, Vec state, double period,
                              const SettledOptions& options);

} // namespace squeal
