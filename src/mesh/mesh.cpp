/// The mesh of a scene: from its file, with the scene's points and reference points.
#include "squeal/mesh/mesh.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/mesh/build.hpp"
#include "squeal/mesh/names.hpp"
#include "superelements.hpp"

namespace squeal
{

namespace
{

template <class T> void broadcast_lists(std::map<std::string, std::vector<T>>& lists, MPI_Comm comm)
{
  std::vector<char> names; // each terminated by a zero
  for (const auto& [name, list] : lists) names.insert(names.end(), name.c_str(), name.c_str() + name.size() + 1);
  broadcast(names, comm);
  for (const char* name = names.data(); name < names.data() + names.size(); name += std::string(name).size() + 1)
    broadcast(lists[name], comm);
}

Mesh read_file(const Scene& scene)
{
  const FileMesh file = read_mesh_file(*scene.mesh);
  try
  {
    return build_mesh(file, scene);
  }
  catch (const Error& error)
  {
    throw Error(scene.mesh->file.string() + ": " + error.what());
  }
}

void add_point(const std::string& name, const Vec3& position, Mesh& mesh)
{
  if (!mesh.points.emplace(name, static_cast<int>(mesh.nodes.size())).second)
    throw Error("two points or rigid bodies are called '" + name + "': rename one");
  mesh.nodes.push_back(position);
}

/// Throws Error if the scene names a point, group or surface that the mesh does not have.
void check_names(const Mesh& mesh, const Scene& scene)
{
  for (const RigidBody& body : scene.rigid_bodies)
    for (const std::string& name : body.surfaces) named_faces(mesh, name, "rigid body '" + body.name + "'");
  for (const Spring& spring : scene.springs)
    for (const std::string& name : {spring.from, spring.to})
      if (name != ground) point_node(mesh, name, "spring");
  for (const Support& support : scene.supports) named_nodes(mesh, support.on, "support");
  for (const Force& force : scene.forces) named_nodes(mesh, force.on, "force");
  for (const Pressure& pressure : scene.pressures) named_faces(mesh, pressure.on, "pressure");
  for (const Contact& contact : scene.contacts)
    for (const std::string& name : {contact.rotor, contact.stator})
      if (!mesh.points.count(name)) named_faces(mesh, name, "contact");
  for (const Probe& probe : scene.probes) named_nodes(mesh, probe.on, "probe '" + probe.name + "'");
}

} // namespace

Mesh read_mesh(const Scene& scene)
{
  Mesh mesh;
  if (scene.mesh)
    mesh = read_file(scene);
  else if (!scene.parts.empty())
    throw Error("part '" + scene.parts.front().name + "' needs a mesh: add [mesh] file = \"...\"");
  for (const Point& point : scene.points) add_point(point.name, point.at, mesh);
  for (const RigidBody& body : scene.rigid_bodies) add_point(body.name, body.at, mesh);
  if (mesh.nodes.empty()) throw Error("the scene has neither a mesh nor points: nothing to compute");
  check_names(mesh, scene);
  add_superelements(scene, mesh);
  return mesh;
}

void broadcast_mesh(Mesh& mesh, MPI_Comm comm)
{
  broadcast(mesh.nodes, comm);
  broadcast(mesh.elements, comm);
  broadcast_lists(mesh.surfaces, comm);
  broadcast_lists(mesh.node_groups, comm);
  broadcast_lists(mesh.dimensions, comm);
  std::map<std::string, std::vector<int>> points;
  for (const auto& [name, node] : mesh.points) points[name] = {node};
  broadcast_lists(points, comm);
  for (const auto& [name, node] : points) mesh.points[name] = node.front();
  auto superelements = mesh.superelements.size();
  MPI_Bcast(&superelements, sizeof superelements, MPI_BYTE, 0, comm);
  mesh.superelements.resize(superelements);
  for (std::vector<SuperelementRow>& rows : mesh.superelements) broadcast(rows, comm);
}

} // namespace squeal
