/// Samples are design points of a sweep, whose first point has the medians: its modes name those of the samples.
#include "squeal/study/robustness.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/base/statistics.hpp"

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/statistics/bivariate_statistics.hpp>
#include <numeric>

namespace squeal
{

namespace
{

std::vector<double> values_at(const std::vector<UncertainNumber>& numbers, const std::vector<double>& parts)
{
  std::vector<double> values;
  for (std::size_t i = 0; i < numbers.size(); ++i) values.push_back(quantile(numbers[i], parts[i]));
  return values;
}

/// The medians, then the samples. Collective: it ends where the run is asked to.
std::vector<std::vector<double>> random_values(const RobustnessSettings& settings,
                                               const std::vector<UncertainNumber>& numbers, MPI_Comm comm)
{
  constexpr int between = 1 << 14; // samples, a few milliseconds
  std::mt19937_64 generator(static_cast<std::uint64_t>(settings.seed));
  std::vector<std::vector<double>> points{values_at(numbers, std::vector(numbers.size(), 0.5))};
  for (int k = 0; k < settings.samples; ++k)
  {
    if (k % between == 0) end_if_asked(comm);
    std::vector<double> parts;
    for (std::size_t i = 0; i < numbers.size(); ++i) parts.push_back(uniform(generator));
    points.push_back(values_at(numbers, parts));
  }
  return points;
}

/// Places of values in ascending order, from 0.
std::vector<double> ranks_of_values(const std::vector<double>& values)
{
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::sort(order, {}, [&](std::size_t i) { return values[i]; });
  std::vector<double> ranks(values.size());
  for (std::size_t k = 0; k < order.size(); ++k) ranks[order[k]] = static_cast<double>(k);
  return ranks;
}

/// Spearman's coefficient of rank correlation.
double rank_correlation(const std::vector<double>& a, const std::vector<double>& b)
{
  return a.size() < 2 ? 0 : boost::math::statistics::correlation_coefficient(ranks_of_values(a), ranks_of_values(b));
}

bool is_known(const SweepPoint& sample)
{
  return sample.outcome.kind == OutcomeKind::converged;
}

/// Rank correlations of each of so many numbers with the largest growth rate over |lambda| of a sample.
std::vector<double> correlations_of(const std::vector<SweepPoint>& samples, std::size_t numbers)
{
  std::vector<double> growth;
  std::vector<std::vector<double>> values(numbers);
  for (const SweepPoint& sample : samples)
  {
    if (sample.modes.empty()) continue;
    const std::complex<double> worst = least_stable(sample).lambda;
    growth.push_back(worst.real() / std::abs(worst));
    for (std::size_t i = 0; i < numbers; ++i) values[i].push_back(sample.values[i]);
  }
  std::vector<double> correlations;
  for (const std::vector<double>& of_number : values) correlations.push_back(rank_correlation(of_number, growth));
  return correlations;
}

/// The unstable modes of the samples that are one mode of the reference, or like none.
RobustMode unstable_as(int mode, const std::vector<SweepPoint>& samples, double confidence)
{
  RobustMode robust;
  robust.number = mode;
  int count = 0;
  for (const SweepPoint& sample : samples)
  {
    const std::size_t before = robust.frequencies.size();
    for (const SweptMode& one : sample.modes)
    {
      if (one.track != mode || !is_unstable(one.lambda)) continue;
      robust.growth_rates.push_back(one.lambda.real());
      robust.frequencies.push_back(frequency_hz_of(one.lambda));
    }
    count += robust.frequencies.size() > before;
  }
  robust.unstable = probability_of(count, static_cast<int>(std::ranges::count_if(samples, is_known)), confidence);
  std::ranges::sort(robust.growth_rates);
  std::ranges::sort(robust.frequencies);
  return robust;
}

} // namespace

const SweptMode& least_stable(const SweepPoint& point)
{
  return *std::ranges::max_element(point.modes, {},
                                   [](const SweptMode& mode) { return mode.lambda.real() / std::abs(mode.lambda); });
}

Probability probability_of(int count, int samples, double confidence)
{
  Probability result{count, samples};
  if (samples == 0) return result;
  using Binomial = boost::math::binomial_distribution<>;
  const double outside = (1 - confidence) / 2;
  result.lower = Binomial::find_lower_bound_on_p(samples, count, outside);
  result.upper = Binomial::find_upper_bound_on_p(samples, count, outside);
  return result;
}

Robustness find_robustness(const RobustnessSettings& settings, const std::vector<UncertainNumber>& numbers,
                           SweepProblem problem, MPI_Comm comm)
{
  problem.settings.design = random_values(settings, numbers, comm);
  Sweep sweep = run_sweep(problem, comm);
  if (sweep.outcome.kind == OutcomeKind::interrupted) throw Interrupted{};
  Robustness result;
  result.outcome = sweep.outcome;
  result.basis = sweep.basis;
  const SweepPoint reference = sweep.points.front();
  sweep.points.erase(sweep.points.begin());
  result.samples = std::move(sweep.points);
  for (SweepPoint& sample : result.samples)
    for (SweptMode& mode : sample.modes) // those of the reference beyond the band have later numbers
      if (mode.track >= static_cast<int>(reference.modes.size())) mode.track = -1;
  result.outcome.iterations = static_cast<int>(result.samples.size());
  const auto any = std::ranges::count_if(result.samples, [](const SweepPoint& s) { return s.unstable > 0; });
  result.any = probability_of(static_cast<int>(any), static_cast<int>(std::ranges::count_if(result.samples, is_known)),
                              settings.confidence);
  result.modes.push_back(unstable_as(-1, result.samples, settings.confidence));
  for (const SweptMode& mode : reference.modes)
    result.modes.emplace_back(unstable_as(mode.track, result.samples, settings.confidence)).lambda = mode.lambda;
  std::erase_if(result.modes, [](const RobustMode& mode) { return mode.unstable.count == 0; });
  std::ranges::stable_sort(result.modes, std::greater{}, [](const RobustMode& mode) { return mode.unstable.count; });
  result.correlation = correlations_of(result.samples, numbers.size());
  return result;
}

} // namespace squeal
