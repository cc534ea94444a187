/// From a mesh file's blocks to the scene's parts, surfaces and groups.
///
/// A solid is outside-out when the volume its faces enclose, by the divergence theorem, is positive.
/// Faces are turned so that they are counter-clockwise seen from outside the solid that has the same corners.
#include "squeal/base/error.hpp"
#include "squeal/mesh/mesh_file.hpp"
#include "squeal/mesh/shapes.hpp"
#include "squeal/mesh/vector.hpp"

#include <algorithm>
#include <optional>
#include <set>

namespace squeal
{

namespace
{

std::optional<Shape> element_shape(int gmsh_type)
{
  switch (gmsh_type)
  {
  case 2:
    return Shape::shell3;
  case 3:
    return Shape::shell4;
  case 5:
    return Shape::hex8;
  case 6:
    return Shape::wedge6;
  case 11:
    return Shape::tet10;
  case 17:
    return Shape::hex20;
  default:
    return {};
  }
}

std::optional<FaceShape> face_shape(int gmsh_type)
{
  switch (gmsh_type)
  {
  case 2:
    return FaceShape::triangle3;
  case 3:
    return FaceShape::quad4;
  case 9:
    return FaceShape::triangle6;
  case 10:
    return FaceShape::quad9;
  case 16:
    return FaceShape::quad8;
  default:
    return {};
  }
}

std::string remedy(int gmsh_type)
{
  switch (gmsh_type)
  {
  case 4:
    return "4-node tetrahedra lock: set Mesh.ElementOrder = 2 for 10-node ones";
  case 12:
    return "set Mesh.SecondOrderIncomplete = 1 for 20-node bricks";
  case 9:
  case 10:
  case 16:
    return "shells are 4- and 3-node: set Mesh.ElementOrder = 1";
  default:
    return "squeal has 8- and 20-node bricks, 6-node wedges, 10-node tetrahedra, 4- and 3-node shells";
  }
}

// Six times the volume inside the element's corner faces: negative when the numbering turns the solid inside out.
double enclosed(const Element& element, const std::vector<Vec3>& nodes)
{
  double sum = 0;
  const int corners = corner_count(element.shape);
  Vec3 centre{};
  for (int i = 0; i < corners; ++i) centre = centre + (1. / corners) * nodes[element.nodes[i]];
  for (const auto& face : corner_faces(element.shape))
    for (int i = 1; i < 3 && face[i + 1] >= 0; ++i)
    {
      const Vec3& a = nodes[element.nodes[face[0]]];
      const Vec3& b = nodes[element.nodes[face[i]]];
      const Vec3& c = nodes[element.nodes[face[i + 1]]];
      sum += dot(a - centre, cross(b - a, c - a));
    }
  return sum;
}

template <class Cell> void mirror(Cell& cell)
{
  const auto before = cell.nodes;
  const std::vector<int> order = mirrored_order(cell.shape);
  for (std::size_t i = 0; i < order.size(); ++i) cell.nodes[i] = before[order[i]];
}

// Which part claims a block; -1: none.
int part_of(const FileBlock& block, const Scene& scene)
{
  int found = -1;
  for (std::size_t p = 0; p < scene.parts.size(); ++p)
  {
    const Part& part = scene.parts[p];
    const int dimension = part.thickness > 0 ? 2 : 3;
    if (dimension != block.dimension) continue;
    if (std::find(block.groups.begin(), block.groups.end(), part.name) == block.groups.end()) continue;
    if (found >= 0)
      throw Error("parts '" + scene.parts[found].name + "' and '" + part.name + "' claim the same elements");
    found = static_cast<int>(p);
  }
  return found;
}

void add_elements(const FileBlock& block, int part, const Scene& scene, Mesh& mesh)
{
  const std::optional<Shape> shape = element_shape(block.type);
  if (!shape)
    throw Error("part '" + scene.parts[part].name + "' has elements '" + block.type_name +
                "', which are not on offer: " + remedy(block.type));
  const int n = block.nodes_per_element;
  for (std::size_t first = 0; first < block.nodes.size(); first += n)
  {
    Element element{*shape, part, {}};
    std::copy_n(block.nodes.begin() + first, n, element.nodes.begin());
    if (!is_shell(*shape) && enclosed(element, mesh.nodes) < 0) mirror(element);
    mesh.elements.push_back(element);
  }
}

void check_parts(const FileMesh& file, const Mesh& mesh, const Scene& scene)
{
  std::array<std::set<std::string>, 4> names;
  for (const FileBlock& block : file.blocks) names[block.dimension].insert(block.groups.begin(), block.groups.end());
  std::vector<char> has_elements(scene.parts.size());
  for (const Element& element : mesh.elements) has_elements[element.part] = 1;
  for (std::size_t p = 0; p < scene.parts.size(); ++p)
  {
    if (has_elements[p]) continue;
    const std::string& name = scene.parts[p].name;
    const bool shell = scene.parts[p].thickness > 0;
    if (!shell && names[2].count(name))
      throw Error("part '" + name + "' is a surface in the mesh: give it a thickness, which makes it a shell");
    if (shell && names[3].count(name))
      throw Error("part '" + name + "' is a volume in the mesh but has a thickness: remove the thickness");
    throw Error("part '" + name + "': the mesh has no elements in a physical " + (shell ? "surface" : "volume") +
                " of that name" + suggestion(name, names[shell ? 2 : 3]));
  }
}

void read_elements(const FileMesh& file, const Scene& scene, Mesh& mesh)
{
  std::map<std::string, std::size_t> unclaimed;
  std::size_t lost = 0;
  for (const FileBlock& block : file.blocks)
  {
    const int part = part_of(block, scene);
    if (part >= 0)
      add_elements(block, part, scene, mesh);
    else if (block.dimension == 3)
    {
      const std::size_t count = block.nodes.size() / block.nodes_per_element;
      lost += count;
      unclaimed[block.groups.empty() ? "" : block.groups.front()] += count;
    }
  }
  check_parts(file, mesh, scene);
  if (!lost) return;
  std::string where;
  for (const auto& [group, count] : unclaimed)
    where += (where.empty() ? "" : ", ") + std::to_string(count) + " in " +
             (group.empty() ? "no physical group" : "physical group '" + group + "'");
  throw Error(std::to_string(lost) + " solid elements belong to no part (" + where +
              "): name their physical volume in a [[part]]");
}

// What a face bounds: the same corners, counter-clockwise from outside, and how many solids have them.
struct Boundary
{
  std::vector<int> corners;
  int solids = 0;
};

using Boundaries = std::map<std::array<int, 4>, Boundary>;

std::array<int, 4> sorted_corners(const std::vector<int>& corners)
{
  std::array<int, 4> key{-1, -1, -1, -1};
  std::copy(corners.begin(), corners.end(), key.begin());
  std::sort(key.begin(), key.end());
  return key;
}

// Of the faces all of whose corners are marked: the others cannot be asked for, and there are many.
Boundaries boundaries_of(const Mesh& mesh, const std::vector<char>& marked)
{
  Boundaries found;
  const auto add = [&](const std::vector<int>& corners, int solids)
  {
    if (!std::all_of(corners.begin(), corners.end(), [&](int node) { return marked[node]; })) return;
    Boundary& boundary = found[sorted_corners(corners)];
    if (!boundary.solids) boundary.corners = corners;
    boundary.solids += solids;
  };
  for (const Element& element : mesh.elements)
  {
    if (is_shell(element.shape)) add({element.nodes.begin(), element.nodes.begin() + corner_count(element.shape)}, 0);
    for (const auto& face : corner_faces(element.shape))
    {
      std::vector<int> corners;
      for (const int i : face)
        if (i >= 0) corners.push_back(element.nodes[i]);
      add(corners, 1);
    }
  }
  return found;
}

void turn_outward(Face& face, const Boundary& boundary)
{
  const auto& corners = boundary.corners;
  const auto first = std::find(corners.begin(), corners.end(), face.nodes[0]);
  const auto next = first + 1 == corners.end() ? corners.begin() : first + 1;
  if (*next != face.nodes[1]) mirror(face);
}

struct SurfaceUse
{
  std::set<std::string> any, contact;
};

SurfaceUse surfaces_used(const Scene& scene)
{
  SurfaceUse use;
  for (const Contact& contact : scene.contacts) use.contact.insert({contact.rotor, contact.stator});
  use.any = use.contact;
  for (const RigidBody& body : scene.rigid_bodies) use.any.insert(body.surfaces.begin(), body.surfaces.end());
  for (const Pressure& pressure : scene.pressures) use.any.insert(pressure.on);
  return use;
}

void add_faces(const FileBlock& block, const std::string& name, const SurfaceUse& use, const Boundaries& boundaries,
               Mesh& mesh)
{
  const std::optional<FaceShape> shape = face_shape(block.type);
  if (!shape)
  {
    if (!use.any.count(name)) return;
    throw Error("surface '" + name + "' has faces '" + block.type_name + "', which are not on offer");
  }
  const int n = block.nodes_per_element, corners = corner_count(*shape);
  std::size_t loose = 0, inside = 0;
  std::vector<Face>& faces = mesh.surfaces[name];
  for (std::size_t first = 0; first < block.nodes.size(); first += n)
  {
    Face face{*shape, {}};
    std::copy_n(block.nodes.begin() + first, n, face.nodes.begin());
    const auto found = boundaries.find(sorted_corners({face.nodes.begin(), face.nodes.begin() + corners}));
    if (found == boundaries.end())
    {
      ++loose;
      continue;
    }
    inside += found->second.solids > 1;
    turn_outward(face, found->second);
    faces.push_back(face);
  }
  if (loose && use.any.count(name))
    throw Error("surface '" + name + "': " + std::to_string(loose) + " faces are not on an element of any part");
  if (inside && use.contact.count(name))
    throw Error("contact surface '" + name + "': " + std::to_string(inside) +
                " faces have a solid on both sides, so the bodies are joined there: give each body its own copy of the "
                "surface and its nodes");
  if (faces.empty()) mesh.surfaces.erase(name);
}

void read_surfaces(const FileMesh& file, const Scene& scene, Mesh& mesh)
{
  std::vector<char> marked(file.nodes.size());
  for (const FileBlock& block : file.blocks)
    if (block.dimension == 2 && !block.groups.empty())
      for (const int node : block.nodes) marked[node] = 1;
  const Boundaries boundaries = boundaries_of(mesh, marked);
  const SurfaceUse use = surfaces_used(scene);
  for (const FileBlock& block : file.blocks)
    if (block.dimension == 2)
      for (const std::string& name : block.groups) add_faces(block, name, use, boundaries, mesh);
}

// New numbers of the nodes that elements use, in the file's order; -1 for the others, which are dropped.
std::vector<int> drop_unused_nodes(Mesh& mesh)
{
  std::vector<int> number(mesh.nodes.size(), -1);
  for (const Element& element : mesh.elements)
    for (int i = 0; i < node_count(element.shape); ++i) number[element.nodes[i]] = 0;
  int kept = 0;
  for (std::size_t i = 0; i < number.size(); ++i)
    if (number[i] == 0)
    {
      mesh.nodes[kept] = mesh.nodes[i];
      number[i] = kept++;
    }
  mesh.nodes.resize(kept);
  for (Element& element : mesh.elements)
    for (int i = 0; i < node_count(element.shape); ++i) element.nodes[i] = number[element.nodes[i]];
  for (auto& [name, faces] : mesh.surfaces)
    for (Face& face : faces)
      for (int i = 0; i < node_count(face.shape); ++i) face.nodes[i] = number[face.nodes[i]];
  return number;
}

} // namespace

Mesh mesh_of(const FileMesh& file, const Scene& scene)
{
  Mesh mesh;
  mesh.nodes = file.nodes;
  if (std::none_of(file.blocks.begin(), file.blocks.end(), [](const FileBlock& block) { return block.dimension > 1; }))
    throw Error("the mesh has no elements: is the geometry empty?");
  read_elements(file, scene, mesh);
  read_surfaces(file, scene, mesh);
  const std::vector<int> number = drop_unused_nodes(mesh);
  std::map<std::string, std::set<int>> groups;
  for (const FileBlock& block : file.blocks)
    for (const std::string& name : block.groups)
      for (const int node : block.nodes)
        if (number[node] >= 0) groups[name].insert(number[node]);
  for (const auto& [name, nodes] : groups) mesh.node_groups[name].assign(nodes.begin(), nodes.end());
  return mesh;
}

} // namespace squeal
