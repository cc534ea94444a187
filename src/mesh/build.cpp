/// Extraction of the scene's parts, surfaces and groups from the element blocks of a mesh file.
///
/// An element whose Jacobian is negative at its middle is numbered inside out; it is then mirrored. A face of a surface
/// takes the nodes of the element that has its corners: it is counter-clockwise seen from outside a solid.
#include "squeal/mesh/mesh_file.hpp"

#include "squeal/base/error.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

namespace squeal
{

namespace
{

constexpr const char* known_elements =
    "they are bricks, wedges, pyramids, tetrahedra, quadrilaterals and triangles, with or without mid-side nodes: set "
    "Mesh.ElementOrder = 2 or 1";

/// Whether the Jacobian at the middle of a solid is negative.
bool is_inside_out(const Element& element, const Mesh& mesh)
{
  const NodePositions x = position_matrix(positions_of(mesh, nodes_of(element)));
  const Eigen::Matrix3d J = shape_functions(element.shape, middle_of(element.shape)).dN * x.transpose();
  return J.determinant() < 0;
}

/// Index of the part whose name is one of the block's groups; -1 if there is none.
int part_of(const ElementBlock& block, const Scene& scene)
{
  int found = -1;
  for (std::size_t p = 0; p < scene.parts.size(); ++p)
  {
    const Part& part = scene.parts[p];
    const int dimension = part.thickness > 0 ? 2 : 3;
    if (dimension != block.dimension) continue;
    if (std::find(block.groups.begin(), block.groups.end(), part.name) == block.groups.end()) continue;
    if (found >= 0)
      throw Error("parts '" + scene.parts[found].name + "' and '" + part.name + "' have the same elements");
    found = static_cast<int>(p);
  }
  return found;
}

void add_elements(const ElementBlock& block, int part, const Scene& scene, Mesh& mesh)
{
  const std::optional<Shape> shape = shape_of(block.type);
  if (!shape || dimension_of(*shape) == 1)
    throw Error("part '" + scene.parts[part].name + "' has elements '" + block.type_name +
                "', for which there is no kernel: " + known_elements);
  const int n = block.nodes_per_element;
  for (std::size_t first = 0; first < block.nodes.size(); first += n)
  {
    Element element{*shape, part, {}};
    std::copy_n(block.nodes.begin() + first, n, element.nodes.begin());
    if (!is_shell(*shape) && is_inside_out(element, mesh)) mirror(element);
    mesh.elements.push_back(element);
  }
}

/// Throws Error if a part has no elements.
void check_parts(const FileMesh& file, const Mesh& mesh, const Scene& scene)
{
  std::array<std::set<std::string>, 4> names; // of the groups of each dimension
  for (const ElementBlock& block : file.blocks) names[block.dimension].insert(block.groups.begin(), block.groups.end());
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
                " of that name" + spelling_hint(name, names[shell ? 2 : 3]));
  }
}

void read_elements(const FileMesh& file, const Scene& scene, Mesh& mesh)
{
  std::map<std::string, std::size_t> without_part; // number of solid elements by group
  std::size_t total = 0;
  for (const ElementBlock& block : file.blocks)
  {
    const int part = part_of(block, scene);
    if (part >= 0)
      add_elements(block, part, scene, mesh);
    else if (block.dimension == 3)
    {
      const std::size_t count = block.nodes.size() / block.nodes_per_element;
      total += count;
      without_part[block.groups.empty() ? "" : block.groups.front()] += count;
    }
  }
  check_parts(file, mesh, scene);
  if (total == 0) return;
  std::string where;
  for (const auto& [group, count] : without_part)
    where += (where.empty() ? "" : ", ") + std::to_string(count) + " in " +
             (group.empty() ? "no physical group" : "physical group '" + group + "'");
  throw Error(std::to_string(total) + " solid elements belong to no part (" + where +
              "): name their physical volume in a [[part]]");
}

/// A side of an element, which a face of a surface may coincide with.
struct ElementSide
{
  Face face;      // counter-clockwise seen from outside the solid
  int solids = 0; // number of solid elements that have these corners
};

using ElementSides = std::map<std::vector<int>, ElementSide>; // by their corners in ascending order

std::vector<int> ascending(std::span<const int> nodes)
{
  std::vector<int> sorted(nodes.begin(), nodes.end());
  std::ranges::sort(sorted);
  return sorted;
}

/// Returns the sides of elements all of whose corners are marked. The others are many and never looked up.
ElementSides marked_sides(const Mesh& mesh, const std::vector<char>& marked)
{
  ElementSides sides;
  const auto add = [&](const Element& element, std::span<const int> corners, int solids)
  {
    if (!std::ranges::all_of(corners, [&](int node) { return marked[node]; })) return;
    ElementSide& side = sides[ascending(corners)];
    if (!side.solids) side.face = face_on(element, corners);
    side.solids += solids;
    side.face.of_shell = side.solids == 0;
  };
  for (const Element& element : mesh.elements)
  {
    if (is_shell(element.shape)) add(element, std::span(element.nodes).first(corner_count(element.shape)), 0);
    for (const std::vector<int>& corners : faces_of(element)) add(element, corners, 1);
  }
  return sides;
}

/// Names of the surfaces that the scene uses; errors in the others do not matter.
struct UsedSurfaces
{
  std::set<std::string> all;
  std::set<std::string> in_contact;
};

UsedSurfaces used_surfaces(const Scene& scene)
{
  UsedSurfaces used;
  for (const Contact& contact : scene.contacts) used.in_contact.insert({contact.rotor, contact.stator});
  used.all = used.in_contact;
  for (const Tie& tie : scene.ties) used.all.insert({tie.slave, tie.master});
  for (const RigidBody& body : scene.rigid_bodies) used.all.insert(body.surfaces.begin(), body.surfaces.end());
  for (const Pressure& pressure : scene.pressures) used.all.insert(pressure.on);
  return used;
}

void add_faces(const ElementBlock& block, const std::string& name, const UsedSurfaces& used, const ElementSides& sides,
               Mesh& mesh)
{
  const std::optional<Shape> shape = shape_of(block.type);
  if (!shape)
  {
    if (!used.all.count(name)) return;
    throw Error("surface '" + name + "' has faces '" + block.type_name +
                "', which squeal cannot integrate over: " + known_elements);
  }
  const int n = block.nodes_per_element, corners = corner_count(*shape);
  std::size_t without_element = 0, between_solids = 0;
  std::vector<Face>& faces = mesh.surfaces[name];
  for (std::size_t first = 0; first < block.nodes.size(); first += n)
  {
    const auto side = sides.find(ascending(std::span(block.nodes).subspan(first, corners)));
    if (side == sides.end())
    {
      ++without_element;
      continue;
    }
    between_solids += side->second.solids > 1;
    faces.push_back(side->second.face);
  }
  if (without_element && used.all.count(name))
    throw Error("surface '" + name + "': " + std::to_string(without_element) +
                " faces are not on an element of any part");
  if (between_solids && used.in_contact.count(name))
    throw Error("contact surface '" + name + "': " + std::to_string(between_solids) +
                " faces have a solid on both sides, so the bodies are joined there: give each body its own copy of the "
                "surface and its nodes");
  if (faces.empty()) mesh.surfaces.erase(name);
}

void read_surfaces(const FileMesh& file, const Scene& scene, Mesh& mesh)
{
  std::vector<char> marked(file.nodes.size()); // nodes of named surfaces
  for (const ElementBlock& block : file.blocks)
    if (block.dimension == 2 && !block.groups.empty())
      for (const int node : block.nodes) marked[node] = 1;
  const ElementSides sides = marked_sides(mesh, marked);
  const UsedSurfaces used = used_surfaces(scene);
  for (const ElementBlock& block : file.blocks)
    if (block.dimension == 2)
      for (const std::string& name : block.groups) add_faces(block, name, used, sides, mesh);
}

std::string named_part(const Element& element, const Scene& scene)
{
  return "part '" + scene.parts[element.part].name + "'";
}

/// Throws Error for two elements on the same nodes.
void check_doubles(const Mesh& mesh, const Scene& scene)
{
  std::map<std::vector<int>, const Element*> known; // by their ascending corners
  for (const Element& element : mesh.elements)
  {
    const auto [twin, is_new] =
        known.emplace(ascending(std::span(element.nodes).first(corner_count(element.shape))), &element);
    if (!is_new)
      throw Error(named_part(*twin->second, scene) + " and " + named_part(element, scene) +
                  " have two elements on the same nodes, at " +
                  node_text(element.nodes[0], mesh.nodes[element.nodes[0]]) +
                  ": the body would count twice there. Remove one from the mesh");
  }
}

/// Corners of a side or a quadrilateral, ascending after -1, and the node in its middle or -1.
using MiddleOfSide = std::pair<std::array<int, 4>, int>;

std::vector<MiddleOfSide> sides_of(const Element& element)
{
  std::vector<MiddleOfSide> sides;
  const std::span<const int> nodes = nodes_of(element);
  const auto add = [&](std::span<const int> corners, int middle)
  {
    auto& [key, node] = sides.emplace_back(std::array{-1, -1, -1, -1}, middle);
    std::ranges::copy(corners, key.begin());
    std::ranges::sort(key);
  };
  for (int next = corner_count(element.shape); std::vector<int> corners : middles_of(element.shape))
  {
    for (int& corner : corners) corner = element.nodes[corner];
    if (corners.size() <= 4) add(corners, element.nodes[next++]);
  }
  const std::size_t middles = sides.size();
  const bool is_full = std::ranges::any_of(middles_of(element.shape), [](const auto& of) { return of.size() == 4; });
  std::vector<std::vector<int>> faces = faces_of(element);
  if (is_shell(element.shape)) faces.emplace_back(nodes.begin(), nodes.begin() + corner_count(element.shape));
  for (const std::vector<int>& face : faces)
  {
    for (std::size_t i = 0; middles == 0 && i < face.size(); ++i)
      add(std::array{face[i], face[(i + 1) % face.size()]}, -1);
    if (face.size() == 4 && !is_full) add(face, -1);
  }
  return sides;
}

/// Throws Error for a mid-side or mid-face node that another element does not have there. A shell need not have those
/// of a solid: they follow its edge (squeal/mesh/contact_pairs.hpp).
void check_middles(const Mesh& mesh, const Scene& scene)
{
  const auto has_middles = [](const Element& element) { return !middles_of(element.shape).empty(); };
  if (std::none_of(mesh.elements.begin(), mesh.elements.end(), has_middles)) return;
  std::map<std::array<int, 4>, std::pair<int, const Element*>> known; // middle and element of each side
  for (const Element& element : mesh.elements)
    for (const auto& [side, middle] : sides_of(element))
    {
      const auto [before, is_new] = known.emplace(side, std::pair(middle, &element));
      const auto [other_middle, other] = before->second;
      if (other_middle == middle) continue;
      const bool has_it = middle > other_middle; // the other one has none, or a lower one
      if (has_it) before->second = {middle, &element};
      if (is_shell((has_it ? *other : element).shape) && !is_shell((has_it ? element : *other).shape)) continue;
      const int hanging = std::max(middle, other_middle);
      throw Error(named_part(has_it ? element : *other, scene) + " has the mid-side " +
                  node_text(hanging, mesh.nodes[hanging]) + " on " + (side[1] < 0 ? "an edge" : "a face") + " that " +
                  named_part(has_it ? *other : element, scene) +
                  " has without it: the bodies would part there. Mesh both by elements of one order");
    }
}

/// Sets the normals of shells. At a node it is the mean of its own and of its part's others that look its way.
void set_normals(Mesh& mesh)
{
  constexpr double same_way = 0.8; // least cosine; beyond is a fold, or a neighbour that is numbered the other way
  std::map<std::pair<int, int>, std::vector<Vec3>> at; // by part and node; as long as the areas there
  for (std::size_t i = 0; i < mesh.elements.size(); ++i)
  {
    const Element& element = mesh.elements[i];
    if (!is_shell(element.shape)) continue;
    const NodePositions x = position_matrix(positions_of(mesh, nodes_of(element)));
    std::vector<Vec3>& own = mesh.normals[static_cast<int>(i)];
    for (const Eigen::Vector3d& place : natural_positions(element.shape))
    {
      const Eigen::Matrix3d J = shape_functions(element.shape, place).dN * x.transpose();
      const Eigen::Vector3d normal = J.row(0).cross(J.row(1));
      at[{element.part, element.nodes[own.size()]}].push_back({normal(0), normal(1), normal(2)});
      own.push_back(at[{element.part, element.nodes[own.size()]}].back());
    }
  }
  for (auto& [i, normals] : mesh.normals)
    for (std::size_t k = 0; k < normals.size(); ++k)
    {
      Vec3 sum{};
      for (const Vec3& other : at[{mesh.elements[i].part, mesh.elements[i].nodes[k]}])
        if (dot(normals[k], other) >= same_way * norm(normals[k]) * norm(other)) sum = sum + other;
      normals[k] = (1 / norm(sum)) * sum;
    }
}

/// Drops the nodes that no element uses. Returns the new number of each node in the file's order; -1 if dropped.
std::vector<int> drop_unused_nodes(Mesh& mesh)
{
  std::vector<int> number(mesh.nodes.size(), -1);
  for (const Element& element : mesh.elements)
    for (const int node : nodes_of(element)) number[node] = 0;
  int kept = 0;
  const std::size_t before = number.size() - mesh.parents.size(); // the last division
  std::vector<NodeWeights> parents;
  for (std::size_t i = 0; i < number.size(); ++i)
    if (number[i] == 0)
    {
      mesh.nodes[kept] = mesh.nodes[i];
      number[i] = kept++;
      if (i < before) continue;
      for (auto& [node, weight] : mesh.parents[i - before]) node = number[node];
      parents.push_back(std::move(mesh.parents[i - before]));
    }
  mesh.nodes.resize(kept);
  mesh.parents = std::move(parents);
  for (Element& element : mesh.elements)
    for (int i = 0; i < node_count(element.shape); ++i) element.nodes[i] = number[element.nodes[i]];
  for (auto& [name, faces] : mesh.surfaces)
    for (Face& face : faces)
      for (int i = 0; i < node_count(face.shape); ++i) face.nodes[i] = number[face.nodes[i]];
  return number;
}

} // namespace

Mesh build_mesh(const FileMesh& file, const Scene& scene)
{
  Mesh mesh;
  mesh.nodes = file.nodes;
  mesh.parents = file.parents;
  if (std::none_of(file.blocks.begin(), file.blocks.end(),
                   [](const ElementBlock& block) { return block.dimension > 1; }))
    throw Error("the mesh has no elements: is the geometry empty?");
  read_elements(file, scene, mesh);
  read_surfaces(file, scene, mesh);
  const std::vector<int> number = drop_unused_nodes(mesh);
  check_doubles(mesh, scene);
  check_middles(mesh, scene);
  set_normals(mesh);
  std::map<std::string, std::set<int>> groups, dimensions;
  for (const ElementBlock& block : file.blocks)
    for (const std::string& name : block.groups)
    {
      dimensions[name].insert(block.dimension);
      for (const int node : block.nodes)
        if (number[node] >= 0) groups[name].insert(number[node]);
    }
  for (const auto& [name, nodes] : groups) mesh.node_groups[name].assign(nodes.begin(), nodes.end());
  for (const auto& [name, found] : dimensions) mesh.dimensions[name].assign(found.begin(), found.end());
  return mesh;
}

} // namespace squeal
