/// Design points of a sweep, from a CSV file: keys in the first line, then a line of values for each point. Empty lines
/// and lines that begin with # are left out.
#include "bound_numbers.hpp"

#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>
#include <fstream>
#include <sstream>

namespace squeal
{

namespace
{

/// The cells of a line without blanks and quotes around them.
std::vector<std::string> cells_of(const std::string& line)
{
  std::vector<std::string> cells;
  std::istringstream text(line);
  for (std::string cell; std::getline(text, cell, ',');)
  {
    constexpr const char* around = " \t\r\"";
    const std::size_t first = cell.find_first_not_of(around), last = cell.find_last_not_of(around);
    cells.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
  }
  return cells;
}

double number_in(const std::string& cell, const std::string& place, const std::string& key)
{
  char* end = nullptr;
  const double value = std::strtod(cell.c_str(), &end);
  if (cell.empty() || *end != 0 || !std::isfinite(value))
    throw Error(place + ": " + key + " = '" + shortened(cell) + "': expected a finite number");
  return value;
}

} // namespace

DesignTable read_design_table(const std::filesystem::path& file)
{
  DesignTable table;
  std::ifstream stream(file);
  int number = 0;
  for (std::string line; std::getline(stream, line);)
  {
    const std::string place = file.string() + ", line " + std::to_string(++number);
    if (constexpr const char* mark = "\xEF\xBB\xBF"; number == 1 && line.starts_with(mark)) line.erase(0, 3); // UTF-8's
    const std::vector<std::string> cells = cells_of(line);
    if (cells.empty() || cells == std::vector<std::string>{""} || cells.front().starts_with('#')) continue;
    if (table.keys.empty())
    {
      table.keys = cells;
      if (cells.size() == 1 && cells[0].find(';') != std::string::npos)
        throw Error(place + ": '" + shortened(cells[0]) +
                    "' has semicolons: put commas between the keys, and points in numbers");
      for (const std::string& key : cells)
        if (std::ranges::count(cells, key) > 1) throw Error(place + ": the key '" + key + "' is there twice");
      continue;
    }
    if (cells.size() != table.keys.size())
      throw Error(place + ": " + std::to_string(cells.size()) + " values for " + std::to_string(table.keys.size()) +
                  " keys: give one each, with a comma between them");
    std::vector<double>& point = table.points.emplace_back();
    for (std::size_t i = 0; i < cells.size(); ++i) point.push_back(number_in(cells[i], place, table.keys[i]));
  }
  if (table.points.empty())
    throw Error(file.string() + " holds no points: give a line of keys such as friction.coefficient,numbers.clamp, and "
                                "a line of values for each point");
  return table;
}

} // namespace squeal
