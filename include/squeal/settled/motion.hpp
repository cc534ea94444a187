#pragma once
/// Means of a series with their error bars, and whether it is stationary (src/README.md, section 7.10). Arithmetic of
/// one rank; no function throws.
#include "squeal/base/petsc.hpp"
#include "squeal/base/words.hpp"
#include "squeal/shooting/flow.hpp"

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace squeal
{

/// A value and its error bar, of 95 %.
struct MeanValue
{
  double value = 0, error = 0;
};

/// Means of successive windows of so many samples, a broken number: over another period than its own a cycle beats.
std::vector<double> means_over(const std::vector<double>& samples, double length);

/// The mean, its bar by means of 8, 16 and 32 batches: the widest of the three. Neighbouring values may depend on each
/// other over less than a batch. Of fewer than 16 values 4 batches; of fewer than 4 no bar (NaN).
MeanValue batch_mean(std::span<const double> series);

/// Whether the means of the first quarter and of the last half agree to 1e-3, or within the bar of their difference
/// (Geweke 1992). The last half gives the bar.
bool is_stationary(std::span<const double> series);

/// Integrated correlation time of a stationary series, in values: 1 + 2 sum of the autocorrelation, summed up to five
/// times itself (Sokal 1997); 1 where values are independent.
double correlation_time(std::span<const double> series);

/// Near 1 where a series has a broad spectrum, near 0 where it has lines alone, however many. It drives a point in a
/// plane that turns by a fixed angle a value. The mean square displacement's correlation with the time is taken, and
/// its median over angles (Gottwald, Melbourne 2004). NaN: fewer than 192 values, or they hardly vary.
double wandering(std::span<const double> series);

/// The number of values to leave out until the rest is stationary: none, an eighth, a quarter or a half. All where
/// that does not do either.
std::size_t values_before_stationary(std::span<const double> series);

/// The rate at which the spread of the series about its mean decays, per value. It is the slope of the logarithm of its
/// standard deviation over 8 batches, positive for a decay.
MeanValue decay_of_spread(std::span<const double> series);

// The largest Lyapunov exponents of a flow along a motion, from its batched tangent (src/README.md, section 7.10). A
// few columns are carried along and made orthonormal again in the energy product after every window of time. The
// logarithms of what they were stretched by are the exponents. Functions that take a flow are collective.

/// Columns that are carried along a motion.
struct TangentBundle
{
  std::vector<Owned<Vec>> columns;         // energy-orthonormal
  std::vector<std::vector<double>> growth; // [column][window] logarithm of its stretching
};

/// `count` columns in no special direction.
TangentBundle make_bundle(const Flow& flow, Vec like, PetscInt count);

/// Carries the columns along the window that the flow recorded last.
void follow_period(const Flow& flow, TangentBundle& bundle);

/// Largest first, per so many windows, from those after the first `skipped`. A column that shears without growing, as
/// on a torus, is stretched in proportion to the time. That is ln 2 over the last half of the windows, which the bars
/// include. Not collective.
std::vector<MeanValue> exponents_of(const TangentBundle& bundle, std::size_t skipped, double windows);

// The amplitude spectrum of a recorded coordinate, its lines, and the base frequencies that they come from
// (src/README.md, section 7.10). Arithmetic of one rank; no function throws.

/// A sinusoid in the signal.
struct Line
{
  double frequency_hz = 0;
  double amplitude = 0;       // in the signal's unit
  double frequency_error = 0; // [Hz] error bar, by the length of the signal
};

/// An amplitude spectrum and its lines.
struct Spectrum
{
  std::vector<double> frequency_hz, amplitude; // of the signal less its mean, under a Hann window
  std::vector<Line> lines;                     // local maxima above 1e-3 of the largest, largest first
  double resolution_hz = 0;                    // one over the length: lines closer than four of these merge
};

/// Frequencies of lines are refined between the points of the transform by the shape of the window.
Spectrum spectrum_of(std::span<const double> samples, double step_size);

/// The frequencies of lines n f_1 + m f_2. `second` is 0 where every line is a multiple of the first.
struct BaseFrequencies
{
  double first = 0, second = 0; // [Hz] of the strongest line, and of the strongest that is no multiple of it
  int closes_after = 0; // periods of the first after which a motion closes whose second is a fraction of it; 0: never
  double explained = 0; // part of the power beside the first's multiples that is in lines n f_1 + m f_2
};

/// The base frequencies of a spectrum, the first one that of its strongest line.
BaseFrequencies base_frequencies(const Spectrum& spectrum);

/// Finds the second frequency beside a given first one.
BaseFrequencies base_frequencies(const Spectrum& spectrum, double first);

/// [s] after which a motion of these comes back; that of the first where the second is no fraction of it.
double period_of(const BaseFrequencies& base);

// The motion that is reached where no cycle attracts: its statistics and its kind, on any flow with a tangent
// (src/README.md, section 7.10).

/// The kind of the attractor.
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
/// it closes. Where fewer than 16 of these were seen, it is a window of any length.
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
