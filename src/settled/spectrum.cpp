#include "squeal/settled/spectrum.hpp"

#include "squeal/base/constants.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <unsupported/Eigen/FFT>

namespace squeal
{

namespace
{

/// The line at a local maximum of the transform. Under a Hann window the larger neighbour over the maximum, r, gives
/// the line's place between the two: (2 r - 1)/(r + 1). Its height there is sin(pi d)/(pi d (1 - d^2)).
Line line_at(const Spectrum& spectrum, std::size_t place)
{
  const double before = spectrum.amplitude[place - 1], here = spectrum.amplitude[place],
               after = spectrum.amplitude[place + 1];
  const double ratio = std::max(before, after) / here;
  const double away = std::clamp((2 * ratio - 1) / (ratio + 1), 0., 0.5) * (after > before ? 1 : -1);
  const double angle = std::numbers::pi * away;
  const double height = std::abs(away) < 1e-6 ? 1 : std::sin(angle) / (angle * (1 - away * away));
  constexpr double bar = 0.1; // of the resolution
  return {(static_cast<double>(place) + away) * spectrum.resolution_hz, here / height, bar * spectrum.resolution_hz};
}

/// Whether a line is of contact that alternates from step to step, which fewer than 2.2 samples a period show.
bool of_grid(const Line& line, const Spectrum& spectrum)
{
  return line.frequency_hz > 0.9 * spectrum.frequency_hz.back();
}

/// Whether a frequency is n f_1 + m d with d the distance of f_2 from the nearest multiple of f_1 and |m| <= 3; m none
/// where there is no f_2. More side bands would hold any frequency. Lines are good to a tenth of the resolution.
bool is_combination(double frequency, double first, double second, double resolution)
{
  const double apart = second - std::round(second / first) * first;
  const int most = second > 0 ? 3 : 0;
  for (int m = -most; m <= most; ++m)
  {
    const double left = frequency - m * apart, n = std::round(left / first);
    if (n >= 0 && std::abs(left - n * first) <= resolution * (0.5 + 0.1 * (n + std::abs(m)))) return true;
  }
  return false;
}

/// The smallest number of periods of the first, at most 12, that is a whole number of periods of the second.
int common_periods(double first, double second, double resolution)
{
  for (int q = 2; q <= 12; ++q)
    if (std::abs(q * second - std::round(q * second / first) * first) <= resolution * 0.1 * q) return q;
  return 0;
}

} // namespace

Spectrum spectrum_of(std::span<const double> samples, double step_size)
{
  Spectrum spectrum;
  const std::size_t size = samples.size() - samples.size() % 2;
  if (size < 16) return spectrum;
  const double mean = std::accumulate(samples.begin(), samples.end(), 0.) / static_cast<double>(samples.size());
  std::vector<double> windowed(size);
  for (std::size_t i = 0; i < size; ++i)
    windowed[i] = (samples[i] - mean) * (1 - std::cos(two_pi * static_cast<double>(i) / static_cast<double>(size)));
  std::vector<std::complex<double>> transform;
  Eigen::FFT<double> fft;
  fft.fwd(transform, windowed);
  spectrum.resolution_hz = 1 / (static_cast<double>(size) * step_size);
  for (std::size_t i = 0; i <= size / 2; ++i)
  {
    spectrum.frequency_hz.push_back(static_cast<double>(i) * spectrum.resolution_hz);
    spectrum.amplitude.push_back(2 * std::abs(transform[i]) / static_cast<double>(size));
  }
  const double largest = *std::max_element(spectrum.amplitude.begin(), spectrum.amplitude.end());
  for (std::size_t i = 2; i + 2 < spectrum.amplitude.size(); ++i)
    if (const double here = spectrum.amplitude[i];
        here > 1e-3 * largest && here >= spectrum.amplitude[i - 1] && here > spectrum.amplitude[i + 1])
      spectrum.lines.push_back(line_at(spectrum, i));
  std::stable_sort(spectrum.lines.begin(), spectrum.lines.end(),
                   [](const Line& a, const Line& b) { return a.amplitude > b.amplitude; });
  return spectrum;
}

BaseFrequencies base_frequencies(const Spectrum& spectrum)
{
  const auto strongest =
      std::ranges::find_if(spectrum.lines, [&](const Line& line) { return !of_grid(line, spectrum); });
  return strongest == spectrum.lines.end() ? BaseFrequencies{} : base_frequencies(spectrum, strongest->frequency_hz);
}

BaseFrequencies base_frequencies(const Spectrum& spectrum, double first)
{
  BaseFrequencies base{first, 0, 0, 0};
  const double resolution = spectrum.resolution_hz;
  for (const Line& line : spectrum.lines)
    if (!of_grid(line, spectrum) && !is_combination(line.frequency_hz, base.first, 0, resolution))
    {
      base.second = line.frequency_hz;
      base.closes_after = common_periods(base.first, base.second, resolution);
      break;
    }
  // a line of the Hann window is four points wide, so that the points themselves can be counted
  double all = 0, explained = 0;
  for (std::size_t i = 0; i < spectrum.amplitude.size(); ++i)
  {
    const double frequency = spectrum.frequency_hz[i], power = spectrum.amplitude[i] * spectrum.amplitude[i];
    const auto near = [&](double away)
    { return is_combination(frequency + away * resolution, base.first, 0, resolution); };
    if (near(-1.5) || near(-0.5) || near(0.5) || near(1.5)) continue;
    all += power;
  }
  for (const Line& line : spectrum.lines)
  {
    if (is_combination(line.frequency_hz, base.first, 0, resolution)) continue;
    // the powers of a line's points sum to 1.5 times its square
    if (is_combination(line.frequency_hz, base.first, base.second, resolution) ||
        (base.second > 0 && is_combination(line.frequency_hz, base.second, base.first, resolution)))
      explained += 1.5 * line.amplitude * line.amplitude;
  }
  base.explained = all > 0 ? std::min(1., explained / all) : 1;
  return base;
}

double period_of(const BaseFrequencies& base)
{
  return std::max(base.closes_after, 1) / base.first;
}

} // namespace squeal
