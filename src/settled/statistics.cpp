#include "squeal/settled/statistics.hpp"

#include "squeal/base/mean.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace squeal
{

namespace
{

double standard_deviation(std::span<const double> values)
{
  const double middle = mean(values);
  double squares = 0;
  for (const double value : values) squares += (value - middle) * (value - middle);
  return std::sqrt(squares / static_cast<double>(values.size() - 1));
}

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

} // namespace squeal
