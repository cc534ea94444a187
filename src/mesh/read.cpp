#include "squeal/base/error.hpp"
#include "squeal/mesh/mesh_file.hpp"

#include <algorithm>
#include <set>

namespace squeal
{

namespace
{

template <class T> void broadcast(std::vector<T>& data, MPI_Comm comm)
{
  static_assert(std::is_trivially_copyable_v<T>);
  unsigned long long size = data.size();
  MPI_Bcast(&size, 1, MPI_UNSIGNED_LONG_LONG, 0, comm);
  data.resize(size);
  char* bytes = reinterpret_cast<char*>(data.data());
  constexpr std::size_t most = 1 << 30; // MPI counts are int
  for (std::size_t done = 0, all = size * sizeof(T); done < all; done += most)
    MPI_Bcast(bytes + done, static_cast<int>(std::min(most, all - done)), MPI_BYTE, 0, comm);
}

template <class T> void broadcast(std::map<std::string, std::vector<T>>& lists, MPI_Comm comm)
{
  std::vector<char> names; // each ended by a zero
  for (const auto& [name, list] : lists) names.insert(names.end(), name.c_str(), name.c_str() + name.size() + 1);
  broadcast(names, comm);
  for (const char* name = names.data(); name < names.data() + names.size(); name += std::string(name).size() + 1)
    broadcast(lists[name], comm);
}

void add_point(const std::string& name, const Vec3& at, Mesh& mesh)
{
  if (!mesh.points.emplace(name, static_cast<int>(mesh.nodes.size())).second)
    throw Error("two points or rigid bodies are called '" + name + "': rename one");
  mesh.nodes.push_back(at);
}

template <class List> std::set<std::string> keys(const List& list)
{
  std::set<std::string> names;
  for (const auto& [name, value] : list) names.insert(name);
  return names;
}

// `user` says which line of the scene asks for `name`.
void check_name(const std::string& user, const std::string& name, const std::set<std::string>& known)
{
  if (known.count(name)) return;
  throw Error(user + ": no '" + name + "' in the mesh or among the points" + suggestion(name, known));
}

void check_names(const Mesh& mesh, const Scene& scene)
{
  const std::set<std::string> surfaces = keys(mesh.surfaces), points = keys(mesh.points);
  std::set<std::string> anything = keys(mesh.node_groups), faces = surfaces;
  anything.insert(points.begin(), points.end());
  faces.insert(points.begin(), points.end());
  for (const RigidBody& body : scene.rigid_bodies)
    for (const std::string& name : body.surfaces) check_name("rigid body '" + body.name + "'", name, surfaces);
  for (const Spring& spring : scene.springs)
    for (const std::string& name : {spring.from, spring.to})
      if (name != "ground") check_name("spring", name, points);
  for (const Support& support : scene.supports) check_name("support", support.on, anything);
  for (const Force& force : scene.forces) check_name("force", force.on, anything);
  for (const Pressure& pressure : scene.pressures) check_name("pressure", pressure.on, surfaces);
  for (const Contact& contact : scene.contacts)
    for (const std::string& name : {contact.rotor, contact.stator}) check_name("contact", name, faces);
  for (const Probe& probe : scene.probes) check_name("probe '" + probe.name + "'", probe.on, anything);
}

} // namespace

Mesh read_mesh(const Scene& scene, MPI_Comm comm)
{
  Mesh mesh;
  if (scene.mesh)
  {
    on_rank_zero(comm,
                 [&]
                 {
                   const FileMesh file = read_mesh_file(*scene.mesh);
                   try
                   {
                     mesh = mesh_of(file, scene);
                   }
                   catch (const Error& error)
                   {
                     throw Error(scene.mesh->file.string() + ": " + error.what());
                   }
                 });
    broadcast(mesh.nodes, comm);
    broadcast(mesh.elements, comm);
    broadcast(mesh.surfaces, comm);
    broadcast(mesh.node_groups, comm);
  }
  else if (!scene.parts.empty())
    throw Error("part '" + scene.parts.front().name + "' needs a mesh: add [mesh] file = \"...\"");
  for (const Point& point : scene.points) add_point(point.name, point.at, mesh);
  for (const RigidBody& body : scene.rigid_bodies) add_point(body.name, body.at, mesh);
  if (mesh.nodes.empty()) throw Error("the scene has neither a mesh nor points: nothing to compute");
  check_names(mesh, scene);
  return mesh;
}

} // namespace squeal
