/// The mesh of a scene: from its file, with the scene's points and reference points; what drives its contacts; axes of
/// local frames.
///
/// A superelement's retained nodes are those of the mesh at the same places. Its modal coordinates are carried by nodes
/// of its own, six a node.
#include "squeal/mesh/mesh.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/packed.hpp"
#include "squeal/mesh/mesh_file.hpp"
#include "squeal/mesh/row_motions.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <array>
#include <Eigen/Geometry>
#include <ranges>
#include <set>

namespace squeal
{

namespace
{

/// Names nothing of these maps: one whose name is near may be meant.
template <class... Maps>
[[noreturn]] void refuse_name(const std::string& what, const std::string& name, const Maps&... maps)
{
  std::vector<std::string> known;
  (std::ranges::copy(maps | std::views::keys, std::back_inserter(known)), ...);
  throw Error(what + spelling_hint(name, known));
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

Mesh read_file(const Scene& scene)
{
  FileMesh file = read_mesh_file(*scene.mesh);
  try
  {
    refine(file, scene.mesh->refine);
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

/// The node of the mesh, among the candidates, where a retained node is.
int joined_node(const Mesh& mesh, const std::set<int>& candidates, const PlacedNode& retained, const std::string& user)
{
  constexpr double same_place = 1e-6; // of the mesh's size: places in a mesh file have as many digits
  const auto distance = [&](int node) { return norm(mesh.nodes[static_cast<std::size_t>(node)] - retained.at); };
  const int nearest =
      *std::min_element(candidates.begin(), candidates.end(), [&](int a, int b) { return distance(a) < distance(b); });
  if (distance(nearest) > same_place * diagonal_of(mesh.nodes))
    throw Error(
        user + ": node " + std::to_string(retained.node) +
        format(" at (%g, %g, %g) m meets no node: the nearest is %.3g m away; mesh the parts so that their nodes "
               "coincide with the retained ones, or name the point or group that has them",
               retained.at[0], retained.at[1], retained.at[2], distance(nearest)));
  return nearest;
}

/// The node of the mesh for each retained node.
std::map<long, int> joined_nodes(const Mesh& mesh, const Superelement& superelement,
                                 const std::vector<PlacedNode>& placed, const std::vector<NodeMotion>& rows)
{
  const std::string user = "superelement " + superelement.name;
  std::set<int> candidates, taken;
  for (const std::string& name : superelement.on)
    for (const int node : named_nodes(mesh, name, user)) candidates.insert(node);
  if (candidates.empty()) throw Error(user + ": the groups that it is joined to have no nodes");
  std::map<long, int> joined;
  for (const NodeMotion& row : rows)
  {
    if (row.motion < 0 || joined.count(row.node)) continue;
    const auto place = std::ranges::find(placed, row.node, &PlacedNode::node);
    if (place == placed.end())
      throw Error(user + ": nodes.txt has no line for node " + std::to_string(row.node) + " of dofs.txt");
    const int node = joined_node(mesh, candidates, *place, user);
    if (!taken.insert(node).second)
      throw Error(user + ": two of its nodes, one of them " + std::to_string(row.node) + ", are at the same place");
    joined[row.node] = node;
  }
  if (joined.empty()) throw Error(user + ": dofs.txt has no motion of a node, so there is nothing to join");
  return joined;
}

/// Adds the nodes of the scene's beams between their ends. Throws Error for ends at one place.
void add_beams(const Scene& scene, Mesh& mesh)
{
  for (const Beam& beam : scene.beams)
  {
    const std::string user = "beam " + beam.name;
    std::vector<int> nodes{point_node(mesh, beam.from, user)};
    const int end = point_node(mesh, beam.to, user);
    if (norm(mesh.nodes[static_cast<std::size_t>(end)] - mesh.nodes[static_cast<std::size_t>(nodes.front())]) == 0)
      throw Error(user + ": its ends " + beam.from + " and " + beam.to + " are at the same place");
    for (int i = 1; i < beam.elements; ++i)
    {
      nodes.push_back(static_cast<int>(mesh.nodes.size()));
      mesh.nodes.push_back({});
    }
    nodes.push_back(end);
    mesh.beams.push_back(std::move(nodes));
  }
  place_points(scene, mesh);
}

/// Adds the scene's superelements to the mesh. Throws Error for a retained node that meets no node of the groups it is
/// joined to, or one that is taken.
void add_superelements(const Scene& scene, Mesh& mesh)
{
  for (const Superelement& superelement : scene.superelements)
  {
    const std::vector<NodeMotion> rows = read_row_motions(superelement.folder / "dofs.txt");
    const std::vector<PlacedNode> placed = read_placed_nodes(superelement.folder / "nodes.txt");
    const auto joined = joined_nodes(mesh, superelement, placed, rows);
    std::vector<SuperelementRow> own;
    int coordinates = 0;
    for (const NodeMotion& row : rows)
    {
      if (row.motion >= 0)
      {
        own.push_back({joined.at(row.node), row.motion, false});
        continue;
      }
      if (coordinates % 6 == 0) mesh.nodes.push_back(placed.front().at);
      own.push_back({static_cast<int>(mesh.nodes.size()) - 1, coordinates++ % 6, true});
    }
    mesh.superelements.push_back(std::move(own));
  }
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
  for (const Coupling& coupling : scene.couplings) add_point(coupling.name, coupling.at, mesh);
  if (mesh.nodes.empty()) throw Error("the scene has neither a mesh nor points: nothing to compute");
  for (const RigidBody& body : scene.rigid_bodies) // whose nodes are found by any group
    for (const std::string& name : body.surfaces) (void)named_faces(mesh, name, "rigid body '" + body.name + "'");
  add_beams(scene, mesh);
  add_superelements(scene, mesh);
  return mesh;
}

void place_points(const Scene& scene, Mesh& mesh)
{
  const auto place_all = [&](const auto& list)
  {
    for (const auto& entry : list) mesh.nodes[static_cast<std::size_t>(mesh.points.at(entry.name))] = entry.at;
  };
  place_all(scene.points);
  place_all(scene.rigid_bodies);
  place_all(scene.couplings);
  for (const std::vector<int>& nodes : mesh.beams)
  {
    const auto at = [&](int node) -> Vec3& { return mesh.nodes[static_cast<std::size_t>(node)]; };
    const Vec3 first = at(nodes.front()), last = at(nodes.back());
    const auto count = static_cast<double>(nodes.size() - 1);
    for (std::size_t i = 1; i + 1 < nodes.size(); ++i)
      at(nodes[i]) = first + static_cast<double>(i) / count * (last - first);
  }
}

double diagonal_of(const std::vector<Vec3>& nodes)
{
  Eigen::AlignedBox3d box;
  for (const Vec3& node : nodes) box.extend(Eigen::Vector3d(node.data()));
  return box.diagonal().norm();
}

int point_node(const Mesh& mesh, const std::string& name, const std::string& user)
{
  if (const auto point = mesh.points.find(name); point != mesh.points.end()) return point->second;
  refuse_name(user + ": there is no point, rigid body or coupling \"" + name + "\"", name, mesh.points);
}

std::vector<int> named_nodes(const Mesh& mesh, const std::string& name, const std::string& user)
{
  if (const auto point = mesh.points.find(name); point != mesh.points.end()) return {point->second};
  if (const auto group = mesh.node_groups.find(name); group != mesh.node_groups.end())
  {
    check_one_meaning(mesh, name, user);
    return group->second;
  }
  refuse_name(user + ": there is no point, rigid body or mesh group \"" + name + "\"", name, mesh.points,
              mesh.node_groups);
}

const std::vector<Face>& named_faces(const Mesh& mesh, const std::string& name, const std::string& user)
{
  if (const auto surface = mesh.surfaces.find(name); surface != mesh.surfaces.end()) return surface->second;
  refuse_name(user + " on \"" + name + "\": the mesh has no such surface", name, mesh.surfaces);
}

std::string node_text(int node, const Vec3& position)
{
  return format("node %d at (%g, %g, %g)", node, position[0], position[1], position[2]);
}

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Face, shape, nodes, of_shell)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SuperelementRow, node, motion, coordinate)

void broadcast_mesh(Mesh& mesh, MPI_Comm comm)
{
  broadcast(mesh.nodes, comm);
  broadcast(mesh.elements, comm);
  broadcast_packed(mesh.surfaces, comm);
  broadcast_packed(mesh.node_groups, comm);
  broadcast_packed(mesh.dimensions, comm);
  broadcast_packed(mesh.normals, comm);
  broadcast_packed(mesh.points, comm);
  broadcast_packed(mesh.beams, comm);
  broadcast_packed(mesh.superelements, comm);
}

std::string part_of(const Scene& scene, const Mesh& mesh, const std::string& surface)
{
  if (mesh.points.contains(surface)) return surface;
  const auto faces = mesh.surfaces.find(surface);
  if (faces == mesh.surfaces.end() || faces->second.empty()) return {};
  const std::span<const int> face = nodes_of(faces->second.front());
  for (const Element& element : mesh.elements)
  {
    const std::span<const int> nodes = nodes_of(element);
    if (std::ranges::all_of(face, [&](int node) { return std::ranges::find(nodes, node) != nodes.end(); }))
      return scene.parts[static_cast<std::size_t>(element.part)].name;
  }
  return {};
}

std::vector<int> rotors_of_contacts(const Scene& scene, const Mesh& mesh)
{
  std::vector<int> rotors;
  const auto rotor_of = [&](const std::string& surface)
  {
    const auto rotor = std::ranges::find(scene.rotors, part_of(scene, mesh, surface), &Rotor::part);
    return rotor == scene.rotors.end() ? -1 : static_cast<int>(rotor - scene.rotors.begin());
  };
  for (const Contact& contact : scene.contacts)
  {
    rotors.push_back(rotor_of(contact.rotor));
    if (const int other = rotor_of(contact.stator); other >= 0 && rotors.back() < 0)
      throw Error("[[contact]] of " + contact.stator + " on " + contact.rotor + ": [[rotor]] " +
                  scene.rotors[static_cast<std::size_t>(other)].part + " has the surface " + contact.stator +
                  ", which the contact names for its stator: exchange rotor and stator");
  }
  return rotors;
}

std::array<Vec3, 3> axes_at(const Frame& frame, const Vec3& place, const std::string& user)
{
  Vec3 first = frame.axis_1, second = frame.axis_2;
  if (frame.cylinder)
  {
    constexpr double rounding = 1e-9; // of the distances to the origin
    const auto& [axis, centre] = *frame.cylinder;
    const Vec3 arm = place - centre, radius = arm - dot(arm, axis) * axis;
    if (norm(radius) <= rounding * std::max(norm(place), norm(centre)))
      throw Error(user + format(": (%g, %g, %g) is on the axis of its cylinder, where no direction is radial: leave it "
                                "out of the group, or move the axis",
                                place[0], place[1], place[2]));
    first = (1 / norm(radius)) * radius;
    second = cross(axis, first);
  }
  return {first, second, cross(first, second)};
}

} // namespace squeal
