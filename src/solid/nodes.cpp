#include "nodes.hpp"

#include "squeal/base/error.hpp"

namespace squeal
{

namespace
{

template <class Map> void add_names(const Map& map, std::vector<std::string>& names)
{
  for (const auto& [name, value] : map) names.push_back(name);
}

[[noreturn]] void refuse(const std::string& asker, const std::string& name, const std::string& kind,
                         const std::vector<std::string>& known)
{
  throw Error(asker + ": there is no " + kind + " \"" + name + "\"" + suggestion(name, known));
}

} // namespace

std::string node_text(int node, const Vec3& at)
{
  return format("node %d at (%g, %g, %g)", node, at[0], at[1], at[2]);
}

std::string node_text(const Mesh& mesh, int node)
{
  return node_text(node, mesh.nodes[static_cast<std::size_t>(node)]);
}

std::vector<int> nodes_named(const Mesh& mesh, const std::string& name, const std::string& asker)
{
  if (const auto point = mesh.points.find(name); point != mesh.points.end()) return {point->second};
  if (const auto group = mesh.node_groups.find(name); group != mesh.node_groups.end()) return group->second;
  std::vector<std::string> known;
  add_names(mesh.points, known);
  add_names(mesh.node_groups, known);
  refuse(asker, name, "point, rigid body or mesh group", known);
}

int point_named(const Mesh& mesh, const std::string& name, const std::string& asker)
{
  if (const auto point = mesh.points.find(name); point != mesh.points.end()) return point->second;
  std::vector<std::string> known;
  add_names(mesh.points, known);
  refuse(asker, name, "point or rigid body", known);
}

} // namespace squeal
