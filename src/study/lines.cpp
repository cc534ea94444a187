#include "lines.hpp"

#include "squeal/base/random.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

/// The values of one number, ascending or descending.
std::vector<double> grid_of(const SweepSettings& settings, std::size_t number)
{
  std::vector<double> values = settings.values;
  std::sort(values.begin(), values.end());
  if (!values.empty()) return values;
  const double from = settings.from[number], to = settings.to[number];
  const int points = settings.points[number];
  for (int i = 0; i < points; ++i) values.push_back(from + i * (to - from) / (points - 1));
  return values;
}

/// Evenly distributed in the ranges.
std::vector<std::vector<double>> random_points(const SweepSettings& settings)
{
  std::mt19937_64 generator(static_cast<std::uint64_t>(settings.seed));
  std::vector<std::vector<double>> points;
  for (int i = 0; i < settings.samples; ++i)
  {
    std::vector<double>& values = points.emplace_back();
    for (std::size_t k = 0; k < settings.key.size(); ++k)
      values.push_back(settings.from[k] + uniform(generator) * (settings.to[k] - settings.from[k]));
  }
  return points;
}

} // namespace

std::vector<SweepLine> lines_of(const SweepSettings& settings)
{
  std::vector<SweepLine> lines;
  if (!settings.design.empty())
    lines.push_back({settings.design, false, false});
  else if (settings.samples > 0)
    lines.push_back({random_points(settings), false, false});
  else if (settings.key.size() == 1)
  {
    SweepLine& line = lines.emplace_back();
    for (const double value : grid_of(settings, 0)) line.points.push_back({value});
  }
  else
    for (const double second : grid_of(settings, 1))
    {
      SweepLine& line = lines.emplace_back();
      for (const double first : grid_of(settings, 0)) line.points.push_back({first, second});
    }
  if (settings.directions == SweepDirections::one) return lines;
  std::vector<SweepLine> both;
  for (const SweepLine& line : lines)
    for (const bool reversed : {false, true}) both.push_back({line.points, reversed, line.ordered});
  return both;
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
  std::vector<SweepLine> share, starts;
  bool begins_line = false;
  for (std::size_t first = 0; const SweepLine& line : lines)
  {
    const std::size_t last = first + line.points.size(), from = std::max(begin, first), to = std::min(end, last);
    if (from < to)
    {
      SweepLine& piece = share.emplace_back(line);
      piece.known = line.ordered && from > first;
      const auto at = [&](std::size_t place) { return line.points.begin() + static_cast<std::ptrdiff_t>(place); };
      piece.points = {at(from - first - (piece.known ? 1 : 0)), at(to - first)};
      begins_line = begins_line || (line.ordered && !piece.known);
    }
    if (first < begin)
    {
      std::erase_if(starts, [&](const SweepLine& start) { return start.reversed == line.reversed; });
      starts.push_back({{line.points.front()}, line.reversed, true, true});
    }
    first = last;
  }
  if (begins_line) share.insert(share.begin(), starts.begin(), starts.end());
  return share;
}

} // namespace squeal
