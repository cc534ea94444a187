#pragma once
/// Random numbers that are the same on every machine, means and deviations.
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>

namespace squeal
{

/// A number in [0, 1). The distributions of the standard library differ from one implementation to another.
inline double uniform(std::mt19937_64& generator)
{
  return static_cast<double>(generator() >> 11) * 0x1p-53;
}

/// The generator splitmix64 (Steele, Lea, Flood 2014), as a hash of a number.
constexpr std::uint64_t splitmix64(std::uint64_t number)
{
  std::uint64_t x = number + 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

/// The mean of a list of numbers, which has at least one. Not collective.
template <class List> double mean(const List& values)
{
  return std::accumulate(values.begin(), values.end(), 0.) / static_cast<double>(values.size());
}

/// The standard deviation of a sample of at least two numbers, by one less than their count. Not collective.
template <class List> double standard_deviation(const List& values)
{
  const double middle = mean(values);
  double squares = 0;
  for (const double value : values) squares += (value - middle) * (value - middle);
  return std::sqrt(squares / static_cast<double>(values.size() - 1));
}

} // namespace squeal
