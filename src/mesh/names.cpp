#include "squeal/mesh/names.hpp"

#include "squeal/base/error.hpp"

namespace squeal
{

namespace
{

template <class Map> void add_keys(const Map& map, std::vector<std::string>& names)
{
  for (const auto& [name, value] : map) names.push_back(name);
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
  if (const auto group = mesh.node_groups.find(name); group != mesh.node_groups.end()) return group->second;
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
