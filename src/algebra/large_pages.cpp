#include "squeal/algebra/large_pages.hpp"

#ifdef __linux__
#include <cstdint>
#include <sys/mman.h>
#endif

namespace squeal
{

std::vector<double> vector_on_large_pages(std::size_t count)
{
  std::vector<double> array;
  array.reserve(count);
#ifdef MADV_HUGEPAGE
  constexpr std::uintptr_t page = 4096;
  const auto start = (reinterpret_cast<std::uintptr_t>(array.data()) + page - 1) / page * page;
  const auto end = reinterpret_cast<std::uintptr_t>(array.data() + count) / page * page;
  // The system may refuse; the array then has small pages.
  if (end > start) (void)madvise(reinterpret_cast<void*>(start), end - start, MADV_HUGEPAGE);
#endif
  return array;
}

} // namespace squeal
