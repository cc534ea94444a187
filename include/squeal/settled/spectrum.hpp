#pragma once
/// The amplitude spectrum of a recorded coordinate, its lines, and the base frequencies that they come from
/// (src/README.md, section 7.10). Arithmetic of one rank; no function throws.
#include <span>
#include <vector>

namespace squeal
{

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

/// Of lines n f_1 + m f_2. `second` is 0 where every line is a multiple of the first.
struct BaseFrequencies
{
  double first = 0, second = 0; // [Hz] of the strongest line, and of the strongest that is no multiple of it
  int closes_after = 0; // periods of the first after which a motion closes whose second is a fraction of it; 0: never
  double explained = 0; // part of the power beside the first's multiples that is in lines n f_1 + m f_2
};

/// The base frequencies of a spectrum, the first one that of its strongest line.
BaseFrequencies base_frequencies(const Spectrum& spectrum);

/// The same with the first frequency given.
BaseFrequencies base_frequencies(const Spectrum& spectrum, double first);

/// [s] after which a motion of these comes back; that of the first where the second is no fraction of it.
double period_of(const BaseFrequencies& base);

} // namespace squeal
