#pragma once
/// Processor time of repeated work, for the programs of tools/bench.
#include "squeal/base/petsc.hpp"

#include <algorithm>
#include <cstdio>

namespace squeal
{

inline double median(std::vector<double> values)
{
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

/// Processor seconds of one call [s].
template <class Work> double seconds_of(Work work)
{
  const double start = processor_time();
  work();
  return processor_time() - start;
}

/// Median processor seconds of `times` calls [s].
template <class Work> double seconds(int times, Work work)
{
  std::vector<double> all;
  for (int i = 0; i < times; ++i) all.push_back(seconds_of(work));
  return median(all);
}

/// The main function of a benchmark: `work` within a session, its Error on standard error.
template <class Work> int bench_main(const char* name, int argc, char** argv, Work work)
{
  Session session(argc, argv, nullptr);
  try
  {
    work();
  }
  catch (const std::exception& error)
  {
    std::fprintf(stderr, "%s: %s\n", name, error.what());
    MPI_Abort(PETSC_COMM_WORLD, 1);
  }
  return 0;
}

} // namespace squeal
