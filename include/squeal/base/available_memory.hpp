#pragma once
/// Memory that programs can still take. This header knows no MPI, because the mesher knows none.
#include <cmath>
#include <fstream>
#include <string>

namespace squeal
{

/// MemAvailable of /proc/meminfo [byte]; infinite where there is none.
inline double available_memory()
{
  std::ifstream info("/proc/meminfo");
  double kilobytes = 0;
  for (std::string word; info >> word;)
    if (word == "MemAvailable:" && info >> kilobytes) return 1024 * kilobytes;
  return HUGE_VAL;
}

} // namespace squeal
