#include "squeal/scene/row_names.hpp"

#include <charconv>

namespace squeal
{

namespace
{

/// Reads a number that is not negative and moves `at` behind it; returns false if there is none.
bool read_number(const char*& at, const char* end, long& value)
{
  const auto [stop, error] = std::from_chars(at, end, value);
  if (error != std::errc() || value < 0) return false;
  at = stop;
  return true;
}

} // namespace

std::optional<RowNames> row_names(const std::string& text)
{
  RowNames names;
  names.nodes = text.starts_with("node:");
  if (!names.nodes && !text.starts_with("dof:")) return {};
  const char* at = text.data() + text.find(':') + 1;
  const char* const end = text.data() + text.size();
  while (true)
  {
    RowNames::Range range;
    if (!read_number(at, end, range.first)) return {};
    range.last = range.first;
    if (at != end && *at == '-' && !read_number(++at, end, range.last)) return {};
    if (range.last < range.first) return {};
    names.ranges.push_back(range);
    if (at == end) return names;
    if (*at++ != ',') return {};
  }
}

} // namespace squeal
