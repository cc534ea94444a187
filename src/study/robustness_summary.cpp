#include "robustness_summary.hpp"

#include "squeal/base/error.hpp"

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <numeric>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;

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
  if (a.size() < 2) return 0;
  const std::vector<double> x = ranks_of_values(a), y = ranks_of_values(b);
  const double n = static_cast<double>(a.size());
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (x[i] - y[i]) * (x[i] - y[i]);
  return 1 - 6 * sum / (n * (n * n - 1));
}

} // namespace

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

void describe(Checkpoint& checkpoint, UnstableMode& mode)
{
  describe_all(checkpoint, mode.mode, mode.lambda);
}

void describe(Checkpoint& checkpoint, SampleResult& result)
{
  RobustSample& sample = result.sample;
  describe_all(checkpoint, sample.values, sample.known, sample.closed, sample.unstable, sample.growth_rate,
               sample.frequency_hz, sample.mode, result.unstable, result.problem);
}

void describe(Checkpoint& checkpoint, CheckResult& result)
{
  RobustCheck& check = result.check;
  describe_all(checkpoint, check.sample, check.known, check.unstable, check.unstable_reduced, check.growth_error,
               check.frequency_error, result.problem);
}

void find_correlations(Robustness& result, std::size_t numbers)
{
  std::vector<double> growth;
  std::vector<std::vector<double>> values(numbers);
  for (const RobustSample& sample : result.samples)
  {
    if (!sample.known || sample.frequency_hz == 0) continue;
    growth.push_back(sample.growth_rate / sample.frequency_hz); // which orders samples as that over |lambda| does
    for (std::size_t i = 0; i < numbers; ++i) values[i].push_back(sample.values[i]);
  }
  for (const std::vector<double>& of_number : values) result.correlation.push_back(rank_correlation(of_number, growth));
}

void find_probabilities(Robustness& result, const std::vector<SampleResult>& samples,
                        const std::vector<Complex>& reference, double confidence)
{
  const auto known = static_cast<int>(std::ranges::count(result.samples, true, &RobustSample::known));
  const auto any = std::ranges::count_if(result.samples, [](const RobustSample& s) { return s.unstable > 0; });
  result.any = probability_of(static_cast<int>(any), known, confidence);
  for (int mode = unmatched; mode < to_int(reference.size()); ++mode)
  {
    RobustMode robust;
    int count = 0;
    for (const SampleResult& sample : samples)
    {
      const std::size_t before = robust.frequencies.size();
      for (const UnstableMode& one : sample.unstable)
      {
        if (one.mode != mode) continue;
        robust.growth_rates.push_back(one.lambda.real());
        robust.frequencies.push_back(frequency_hz_of(one.lambda));
      }
      count += robust.frequencies.size() > before;
    }
    if (count == 0) continue;
    if (mode != unmatched) robust.lambda = reference[static_cast<std::size_t>(mode)];
    robust.number = mode;
    robust.unstable = probability_of(count, known, confidence);
    std::ranges::sort(robust.growth_rates);
    std::ranges::sort(robust.frequencies);
    result.modes.push_back(std::move(robust));
  }
  std::ranges::stable_sort(result.modes, std::greater{}, [](const RobustMode& mode) { return mode.unstable.count; });
}

void assess(Robustness& result, const std::vector<SampleResult>& samples, const std::vector<CheckResult>& checks)
{
  for (const RobustCheck& check : result.checks)
    result.outcome.residual = std::max(result.outcome.residual, check.growth_error);
  result.outcome.iterations = static_cast<int>(samples.size());
  result.outcome.kind = OutcomeKind::converged;
  std::size_t failed = 0, failed_checks = 0, first = 0;
  std::string reason;
  const auto count = [&](const auto& results, std::size_t& number)
  {
    for (std::size_t k = 0; k < results.size(); ++k)
      if (!results[k].problem.empty() && ++number == 1 && reason.empty()) first = k, reason = results[k].problem;
  };
  count(samples, failed);
  count(checks, failed_checks);
  if (reason.empty()) return;
  result.outcome.kind = OutcomeKind::not_converged;
  result.outcome.reason = format("%zu of %zu samples and %zu of %zu checks failed, the first at sample %zu: ", failed,
                                 samples.size(), failed_checks, checks.size(), first) +
                          reason;
}

} // namespace squeal
