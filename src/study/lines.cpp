#include "lines.hpp"

#include <algorithm>

namespace squeal
{

std::vector<SweepLine> lines_of(const SweepSettings& settings)
{
  SweepLine line{settings.design, false, settings.design.empty()};
  std::vector<double> values = settings.values;
  std::ranges::sort(values);
  if (line.ordered && values.empty())
    for (int i = 0; i < settings.points; ++i)
      values.push_back(settings.from + i * (settings.to - settings.from) / (settings.points - 1));
  for (const double value : values) line.points.push_back({value});
  std::vector<SweepLine> lines{line};
  line.reversed = true;
  if (settings.directions == SweepDirections::both) lines.push_back(line);
  return lines;
}

std::size_t points_of(const std::vector<SweepLine>& lines)
{
  std::size_t points = 0;
  for (const SweepLine& line : lines) points += line.points.size();
  return points;
}

std::vector<SweepLine> share_of(const std::vector<SweepLine>& lines, int group, int groups)
{
  const std::size_t total = points_of(lines);
  const auto begin_of = [&](int g) { return total * static_cast<std::size_t>(g) / static_cast<std::size_t>(groups); };
  const std::size_t begin = begin_of(group), end = begin_of(group + 1);
  std::vector<SweepLine> share;
  for (std::size_t first = 0; const SweepLine& line : lines)
  {
    const std::size_t last = first + line.points.size(), from = std::max(begin, first), to = std::min(end, last);
    if (from < to)
    {
      SweepLine& piece = share.emplace_back(line);
      const auto at = [&](std::size_t place) { return line.points.begin() + static_cast<std::ptrdiff_t>(place); };
      piece.points = {at(from - first), at(to - first)};
      piece.continued = from > first;
      if (piece.continued) piece.points.insert(piece.points.begin(), *at(line.ordered ? from - first - 1 : 0));
    }
    first = last;
  }
  return share;
}

} // namespace squeal
