#include "squeal/mesh/row_motions.hpp"

#include "squeal/base/error.hpp"
#include "squeal/scene/scene.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

namespace squeal
{

namespace
{

/// Calls read(line, place) for every line of a file.
template <class Read> void for_each_line(const std::filesystem::path& file, Read read)
{
  if (!is_file(file)) throw Error(file.string() + ": no such file; tools/matrices writes one");
  std::ifstream stream(file);
  if (!stream) throw Error(file.string() + ": cannot be read");
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number)
    read(line, file.string() + ", line " + std::to_string(number));
}

/// Whether a line consists of these values.
template <class... Values> bool reads(const std::string& line, Values&... values)
{
  std::istringstream words(line);
  std::string rest;
  return (words >> ... >> values) && !(words >> rest);
}

NodeMotion motion_in(const std::string& line, const std::string& place)
{
  NodeMotion found;
  std::string motion;
  const bool is_form = reads(line, found.node, motion);
  const auto* const known = std::find(motion_words.begin(), motion_words.end(), motion);
  if (!is_form || (known == motion_words.end() && motion != "-"))
    throw Error(
        place + ": '" + shortened(line) +
        "': expected a node's number and one of x y z rx ry rz, such as '1017 x'; or any number and '-', such as "
        "'1 -', for what is no motion of a node");
  if (known != motion_words.end()) found.motion = static_cast<int>(known - motion_words.begin());
  return found;
}

} // namespace

std::vector<NodeMotion> read_row_motions(const std::filesystem::path& file)
{
  std::vector<NodeMotion> motions;
  std::set<std::pair<long, int>> seen;
  for_each_line(file,
                [&](const std::string& line, const std::string& place)
                {
                  motions.push_back(motion_in(line, place));
                  const NodeMotion& last = motions.back();
                  if (last.motion >= 0 && !seen.insert({last.node, last.motion}).second)
                    throw Error(place + ": '" + line +
                                "' is there twice: each row of the matrices is a motion of its own");
                });
  return motions;
}

std::vector<PlacedGap> read_gaps(const std::filesystem::path& file)
{
  std::vector<PlacedGap> gaps;
  for_each_line(file,
                [&](const std::string& line, const std::string& place)
                {
                  auto& [at, gap] = gaps.emplace_back();
                  if (!reads(line, at[0], at[1], at[2], gap) || !std::isfinite(norm(at) + gap))
                    throw Error(place + ": '" + shortened(line) + "': expected x, y, z and the gap in m");
                });
  return gaps;
}

std::vector<PlacedNode> read_placed_nodes(const std::filesystem::path& file)
{
  std::vector<PlacedNode> nodes;
  std::set<long> seen;
  for_each_line(file,
                [&](const std::string& line, const std::string& place)
                {
                  PlacedNode found;
                  auto& [x, y, z] = found.at;
                  if (!reads(line, found.node, x, y, z) || !std::isfinite(norm(found.at)))
                    throw Error(place + ": '" + shortened(line) + "': expected a node's number and its x, y, z in m");
                  if (!seen.insert(found.node).second)
                    throw Error(place + ": node " + std::to_string(found.node) + " is there twice");
                  nodes.push_back(found);
                });
  return nodes;
}

} // namespace squeal
