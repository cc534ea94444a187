#pragma once
/// The mean of a series.
#include <numeric>

namespace squeal
{

/// The mean of a list of numbers, which has at least one. Not collective.
template <class List> double mean(const List& values)
{
  return std::accumulate(values.begin(), values.end(), 0.) / static_cast<double>(values.size());
}

} // namespace squeal
