#include "squeal/algebra/multivector.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/statistics.hpp"
#include "squeal/settled/motion.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <unsupported/Eigen/FFT>
#include <vector>

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

namespace
{

/// The values of each of `count` batches of equal length; what is left over at the start is left out.
std::vector<std::span<const double>> batches_of(std::span<const double> series, std::size_t count)
{
  const std::size_t length = series.size() / count;
  std::vector<std::span<const double>> batches;
  for (std::size_t i = 0; i < count; ++i)
    batches.push_back(series.subspan(series.size() - (count - i) * length, length));
  return batches;
}

double batch_error(std::span<const double> series, std::size_t count, double student)
{
  std::vector<double> means;
  for (const auto batch : batches_of(series, count)) means.push_back(mean(batch));
  return student * standard_deviation(means) / std::sqrt(static_cast<double>(count));
}

} // namespace

std::vector<double> means_over(const std::vector<double>& samples, double length)
{
  std::vector<double> before(samples.size() + 1, 0.); // sums
  std::partial_sum(samples.begin(), samples.end(), before.begin() + 1);
  const auto sum_to = [&](double place)
  {
    const auto whole = std::min(static_cast<std::size_t>(place), samples.size() - 1);
    return before[whole] + (place - static_cast<double>(whole)) * samples[whole];
  };
  std::vector<double> means;
  for (double end = length; end <= static_cast<double>(samples.size()); end += length)
    means.push_back((sum_to(end) - sum_to(end - length)) / length);
  return means;
}

MeanValue batch_mean(std::span<const double> series)
{
  if (series.empty()) return {std::nan(""), std::nan("")};
  MeanValue result{mean(series), std::nan("")};
  if (series.size() < 4) return result;
  if (series.size() < 16) return {result.value, batch_error(series, 4, 3.182)};
  result.error = 0;
  // Student's t of 95 % for one degree of freedom less than there are batches
  for (const auto& [count, student] : {std::pair{8UL, 2.365}, {16UL, 2.131}, {32UL, 2.040}})
    if (series.size() >= 2 * count) result.error = std::max(result.error, batch_error(series, count, student));
  return result;
}

bool is_stationary(std::span<const double> series)
{
  if (series.size() < 16) return false;
  const double early = mean(series.first(series.size() / 4));
  const MeanValue late = batch_mean(series.last(series.size() / 2));
  // The late half alone gives the variance: a drift would widen the early quarter's own bar. Half as many values have
  // twice its variance, and the difference three times.
  return std::abs(early - late.value) <= std::max(std::sqrt(3.) * late.error, 1e-3 * std::abs(late.value));
}

double correlation_time(std::span<const double> series)
{
  const double middle = mean(series);
  const auto covariance = [&](std::size_t lag)
  {
    double sum = 0;
    for (std::size_t i = lag; i < series.size(); ++i) sum += (series[i] - middle) * (series[i - lag] - middle);
    return sum;
  };
  const double variance = covariance(0);
  double time = 1;
  if (!(variance > 0)) return time;
  constexpr double window = 5; // times: of what decays exponentially, e^-5 is left out
  for (std::size_t lag = 1; lag < series.size() && static_cast<double>(lag) <= window * time; ++lag)
    time += 2 * covariance(lag) / variance;
  return std::max(time, 1.);
}

double wandering(std::span<const double> series)
{
  constexpr int turns = 64, fewest = 192;
  constexpr double least = 0.05; // of the mean: contact within steps scatters a regular motion by less
  const int size = to_int(series.size()), longest = size / 10;
  const double middle = mean(series);
  if (size < fewest || standard_deviation(series) < least * middle) return std::nan("");
  const Eigen::ArrayXd time = Eigen::ArrayXd::LinSpaced(longest, 1 - longest, longest - 1);
  std::vector<double> found;
  for (int k = 1; k <= turns; ++k)
  {
    const double turn = std::numbers::pi / 5 * (1 + 3 * std::fmod(k * std::numbers::phi, 1));
    Eigen::ArrayXcd places(size);
    std::complex<double> place = 0;
    for (int i = 0; i < size; ++i)
      places(i) = place += std::polar(1., turn * i) * (series[static_cast<std::size_t>(i)] - middle);
    Eigen::ArrayXd moved(longest);
    for (int n = 1; n <= longest; ++n)
      moved(n - 1) = (places.segment(n, size - longest) - places.head(size - longest)).abs2().sum();
    moved -= moved.mean();
    found.push_back((moved * time).sum() / std::sqrt(moved.square().sum() * time.square().sum()));
  }
  std::ranges::nth_element(found, found.begin() + turns / 2);
  return found[turns / 2];
}

std::size_t values_before_stationary(std::span<const double> series)
{
  for (const std::size_t left_out : {std::size_t{0}, series.size() / 8, series.size() / 4, series.size() / 2})
    if (is_stationary(series.subspan(left_out))) return left_out;
  return series.size();
}

MeanValue decay_of_spread(std::span<const double> series)
{
  constexpr std::size_t count = 8;
  if (series.size() < 4 * count) return {0, HUGE_VAL};
  const double length = static_cast<double>(series.size() / count);
  std::vector<double> logarithms;
  for (const auto batch : batches_of(series, count)) logarithms.push_back(std::log(standard_deviation(batch) + 1e-300));
  // least squares on the batches' places -3.5 ... 3.5, whose squares sum to 42
  const double middle = mean(logarithms);
  double slope = 0, squares = 0;
  for (std::size_t i = 0; i < count; ++i) slope += (static_cast<double>(i) - 3.5) * logarithms[i] / 42;
  for (std::size_t i = 0; i < count; ++i)
  {
    const double missed = logarithms[i] - middle - slope * (static_cast<double>(i) - 3.5);
    squares += missed * missed;
  }
  return {-slope / length, 2.447 * std::sqrt(squares / 6 / 42) / length}; // Student's t for 6 degrees of freedom
}

namespace
{

/// Gram-Schmidt. Returns the length of each column before it was scaled, beside those before it.
std::vector<double> orthonormalise(const Flow& flow, std::vector<Owned<Vec>>& columns)
{
  std::vector<double> lengths;
  for (std::size_t k = 0; k < columns.size(); ++k)
  {
    for (int pass = 0; pass < 2; ++pass)
      for (std::size_t j = 0; j < k; ++j)
        check(VecAXPY(columns[k], -energy_product(flow, columns[j], columns[k]), columns[j]));
    lengths.push_back(std::max(energy_norm(flow, columns[k]), 1e-300));
    check(VecScale(columns[k], 1 / lengths.back()));
  }
  return lengths;
}

} // namespace

TangentBundle make_bundle(const Flow& flow, Vec like, PetscInt count)
{
  TangentBundle bundle;
  const MultiVector random = random_multivector(flow.M, 2 * count);
  for (PetscInt k = 0; k < count; ++k)
  {
    Owned<Vec> column = zeros_like(like);
    copy_column(random, 2 * k, displacement(column));
    copy_column(random, 2 * k + 1, velocity(column));
    // both parts weigh about the same, each column's in a ratio of its own: one degree of freedom has two columns
    const Owned<Vec> image = zeros_like(like);
    energy_image(flow, column, image);
    const double of_u = dot(displacement(column), displacement(image)), of_v = dot(velocity(column), velocity(image));
    if (of_u > 0 && of_v > 0)
      check(VecScale(velocity(column), (1 + 0.37 * static_cast<double>(k)) * std::sqrt(of_u / of_v)));
    bundle.columns.push_back(std::move(column));
  }
  orthonormalise(flow, bundle.columns);
  bundle.growth.resize(static_cast<std::size_t>(count));
  return bundle;
}

void follow_period(const Flow& flow, TangentBundle& bundle)
{
  flow.apply_tangent(std::vector<Vec>(bundle.columns.begin(), bundle.columns.end()));
  if (flow.offsets.without_held) // each held one has an exponent zero
    for (const Owned<Vec>& column : bundle.columns)
    {
      flow.offsets.without_held(displacement(column));
      flow.offsets.without_held(velocity(column));
    }
  const std::vector<double> lengths = orthonormalise(flow, bundle.columns);
  for (std::size_t k = 0; k < lengths.size(); ++k) bundle.growth[k].push_back(std::log(lengths[k]));
}

std::vector<MeanValue> exponents_of(const TangentBundle& bundle, std::size_t skipped, double windows)
{
  std::vector<MeanValue> exponents;
  for (const std::vector<double>& growth : bundle.growth)
  {
    if (growth.size() < skipped + 4) return {};
    const std::vector<double> counted(growth.begin() + to_int(skipped), growth.end());
    const auto length = static_cast<double>(counted.size());
    constexpr double fewest = 16; // whole periods, within which a motion stretches unevenly
    const MeanValue mean = batch_mean(means_over(counted, fewest * windows <= length ? std::max(windows, 1.) : 1.));
    const double shear = std::numbers::ln2 / length;
    exponents.push_back({windows * mean.value, windows * (mean.error + shear)});
  }
  std::stable_sort(exponents.begin(), exponents.end(),
                   [](const MeanValue& a, const MeanValue& b) { return a.value > b.value; });
  return exponents;
}

} // namespace squeal
