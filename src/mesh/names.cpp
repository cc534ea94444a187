#include "squeal/mesh/names.hpp"

#include "squeal/base/error.hpp"

#include <array>

namespace squeal
{

namespace
{

template <class Map> void add_keys(const Map& map, std::vector<std::string>& names)
{
  for (const auto& [name, value] : map) names.push_back(name);
}

/// Nodes of a surface and of a volume of one name are those of the volume: a support would hold all of it.
void check_one_meaning(const Mesh& mesh, const std::string& name, const std::string& user)
{
  constexpr std::array words = {"points", "curves", "surfaces", "volumes"};
  const auto found = mesh.dimensions.find(name);
  if (found == mesh.dimensions.end() || found->second.size() < 2) return;
  const int lowest = found->second.front(), highest = found->second.back();
  throw Error(user + ": \"" + name + "\" names " + words.at(static_cast<std::size_t>(lowest)) + " and " +
              words.at(static_cast<std::size_t>(highest)) + " of the mesh: give each a name of its own");
}

} // namespace

int point_node(const Mesh& mesh, const std::string& name, const std::string& user)
{
  if (const auto point = mesh.points.find(name); point != mesh.points.end()) return point->second;
  std::vector<std::string> known;
  add_keys(mesh.points, known);
  throw Error(user + ": there is no point or rigid body \"" + name + "\"" + spelling_hint(name, known));
}

std::vector<int> named_nodes(const Mesh& mesh, const std::string& name, const std::string& user)
{
  if (const auto point = mesh.points.find(name); point != mesh.points.end()) return {point->second};
  if (const auto group = mesh.node_groups.find(name); group != mesh.node_groups.end())
  {
    check_one_meaning(mesh, name, user);
    return group->second;
  }
  std::vector<std::string> known;
  add_keys(mesh.points, known);
  add_keys(mesh.node_groups, known);
  throw Error(user + ": there is no point, rigid body or mesh group \"" + name + "\"" + spelling_hint(name, known));
}

const std::vector<Face>& named_faces(const Mesh& mesh, const std::string& name, const std::string& user)
{
  if (const auto surface = mesh.surfaces.find(name); surface != mesh.surfaces.end()) return surface->second;
  std::vector<std::string> known;
  add_keys(mesh.surfaces, known);
  throw Error(user + " on \"" + name + "\": the mesh has no such surface" + spelling_hint(name, known));
}

std::string node_text(int node, const Vec3& position)
{
  return format("node %d at (%g, %g, %g)", node, position[0], position[1], position[2]);
}

} // namespace squeal
