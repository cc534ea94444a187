#pragma once
/// Memory as the system tells it. This header knows no MPI, because the mesher knows none.
#include <cmath>
#include <fstream>
#include <optional>
#include <string>

namespace squeal
{

/// An entry of a file such as /proc/meminfo [byte]; nothing where there is none.
inline std::optional<double> memory_entry(const char* file, const char* key)
{
  std::ifstream entries(file);
  double kilobytes = 0;
  for (std::string word; entries >> word;)
    if (word == key && entries >> kilobytes) return 1024 * kilobytes;
  return {};
}

/// MemAvailable [byte]; infinite where the system does not say.
inline double available_memory()
{
  return memory_entry("/proc/meminfo", "MemAvailable:").value_or(HUGE_VAL);
}

} // namespace squeal
