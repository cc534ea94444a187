#include "squeal/attractors/reached.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

namespace squeal
{

namespace
{

constexpr std::size_t batches = 10; // of the second half of the motion

/// The mean of a list's part.
double mean_of(const std::vector<double>& values, std::size_t first, std::size_t count)
{
  return std::accumulate(values.begin() + static_cast<std::ptrdiff_t>(first),
                         values.begin() + static_cast<std::ptrdiff_t>(first + count), 0.) /
         static_cast<double>(count);
}

/// Mean, scatter and straight line of the batches' means.
struct Window
{
  double mean = 0, largest_deviation = 0;
  double standard_error = 0; // of the mean
  double trend = 0;          // change over the window by the straight line
  double trend_error = 0;    // its standard error
};

Window window_of(const std::vector<double>& values)
{
  Window window;
  const std::size_t length = values.size() / 2 / batches, first = values.size() - length * batches;
  std::array<double, batches> means{};
  for (std::size_t k = 0; k < batches; ++k) means[k] = mean_of(values, first + k * length, length);
  const double n = batches;
  window.mean = std::accumulate(means.begin(), means.end(), 0.) / n;
  double along = 0, squares = 0, left = 0;
  for (std::size_t k = 0; k < batches; ++k)
  {
    const double place = static_cast<double>(k) / (n - 1) - 0.5;
    along += place * means[k];
    squares += place * place;
    window.largest_deviation = std::max(window.largest_deviation, std::abs(means[k] - window.mean));
  }
  window.trend = along / squares;
  for (std::size_t k = 0; k < batches; ++k)
  {
    const double place = static_cast<double>(k) / (n - 1) - 0.5;
    left += std::pow(means[k] - window.mean - window.trend * place, 2);
  }
  const double scatter = std::sqrt(left / (n - 2));
  window.standard_error = scatter / std::sqrt(n);
  window.trend_error = scatter / std::sqrt(squares);
  return window;
}

/// Whether the second half of the motion comes nearer to its last mean in every quarter, as on the way to a cycle.
bool approaches(const std::vector<double>& values)
{
  constexpr double nearer = 0.7; // a motion that wanders has three such ratios in a row in a few percent of all cases
  const std::size_t quarter = values.size() / 8, first = values.size() - 4 * quarter;
  const double last = mean_of(values, first + 3 * quarter, quarter);
  const auto distance = [&](std::size_t k)
  {
    double squares = 0;
    for (std::size_t i = first + k * quarter; i < first + (k + 1) * quarter; ++i)
      squares += (values[i] - last) * (values[i] - last);
    return std::sqrt(squares);
  };
  double before = distance(0);
  for (const std::size_t k : {1U, 2U, 3U})
  {
    const double now = distance(k);
    if (!(now < nearer * before)) return false;
    before = now;
  }
  return true;
}

bool agree(const MeanValue& a, const MeanValue& b, double relative)
{
  return std::abs(a.value - b.value) <= a.error + b.error + relative * std::max(std::abs(a.value), std::abs(b.value));
}

bool same(const ReachedMotion& a, const ReachedMotion& b)
{
  if (a.kind != b.kind) return false;
  return a.kind == ReachedKind::rest || agree(a, b);
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

MeanValue frequency_of(const std::vector<double>& crossings)
{
  const std::size_t count = crossings.size();
  if (count < 8) return {};
  const auto between = [&](std::size_t first, std::size_t last)
  { return static_cast<double>(last - first) / (crossings[last] - crossings[first]); };
  const std::size_t half = count / 2, quarter = (half + count - 1) / 2;
  return {between(half, count - 1), std::abs(between(half, quarter) - between(quarter, count - 1))};
}

bool agree(const ReachedMotion& a, const ReachedMotion& b)
{
  return agree(a.energy, b.energy, 0.01) && agree(a.frequency, b.frequency, 1e-3);
}

bool is_cycle(const ReachedMotion& motion, double energy, double frequency)
{
  const double times = std::max(1., std::round(motion.frequency.value / frequency));
  return agree(motion, {motion.kind, {energy, 0}, {times * frequency, 0}, {}});
}

ReachedMotion reached_by(const std::vector<double>& energies, const std::vector<double>& crossings, double rest)
{
  constexpr double steady = 0.005, trend_allowed = 0.005; // of the mean
  ReachedMotion reached;
  if (energies.size() < 2 * batches)
  {
    if (energies.empty()) return reached;
    const std::span half = std::span(energies).subspan(energies.size() / 2);
    const auto [least, most] = std::ranges::minmax(half.size() > 1 ? half : std::span(energies));
    reached.energy = {mean_of(energies, energies.size() / 2, half.size()), most - least};
    reached.frequency = frequency_of(crossings);
    return reached;
  }
  const Window window = window_of(energies);
  reached.energy = {window.mean, 2 * window.standard_error + std::abs(window.trend)};
  if (energies.back() < rest)
  {
    reached.kind = ReachedKind::rest;
    return reached;
  }
  reached.frequency = frequency_of(crossings);
  // three standard errors: a motion without trend shows such a one in a percent of all cases (t, 8 degrees of freedom)
  const bool has_trend =
      std::abs(window.trend) > std::max(trend_allowed * window.mean, 3.4 * window.trend_error) || !(window.mean > 0);
  if (has_trend)
    reached.kind = ReachedKind::unsettled;
  else if (window.largest_deviation < steady * window.mean)
    reached.kind = ReachedKind::steady;
  else
    reached.kind = approaches(energies) ? ReachedKind::unsettled : ReachedKind::varying;
  return reached;
}

std::vector<ReachedMotion> joined(std::vector<ReachedMotion> motions)
{
  std::vector<ReachedMotion> list;
  for (ReachedMotion& motion : motions)
  {
    const auto known =
        std::find_if(list.begin(), list.end(), [&](const ReachedMotion& other) { return same(motion, other); });
    if (known == list.end())
      list.push_back(std::move(motion));
    else
      known->starts.insert(known->starts.end(), motion.starts.begin(), motion.starts.end());
  }
  std::stable_sort(list.begin(), list.end(),
                   [](const ReachedMotion& a, const ReachedMotion& b) { return a.starts.size() > b.starts.size(); });
  return list;
}

} // namespace squeal
