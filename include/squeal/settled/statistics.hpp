#pragma once
/// Means of a series with their error bars, and whether it is stationary (src/README.md, section 7.10). Arithmetic of
/// one rank; no function throws.
#include <cstddef>
#include <span>
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

/// The number of values to leave out until the rest is stationary: none, an eighth, a quarter or a half. All where
/// that does not do either.
std::size_t values_before_stationary(std::span<const double> series);

/// The rate at which the spread of the series about its mean decays, per value. It is the slope of the logarithm of its
/// standard deviation over 8 batches, positive for a decay.
MeanValue decay_of_spread(std::span<const double> series);

} // namespace squeal
