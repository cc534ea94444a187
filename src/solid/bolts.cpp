#include "contributions.hpp"

#include "squeal/base/disjoint_sets.hpp"
#include "squeal/base/error.hpp"
#include "squeal/mesh/shapes.hpp"

#include <algorithm>
#include <map>
#include <set>

namespace squeal
{

namespace
{

using Corners = std::vector<int>; // ascending

/// Elements at the nodes of a section, and the faces that they share there.
struct Around
{
  std::vector<int> elements;
  std::map<Corners, std::vector<int>> faces; // elements of each face with a node of the section
};

bool is_on(const std::vector<int>& section, int node)
{
  return std::ranges::binary_search(section, node);
}

Around around(const Mesh& mesh, const std::vector<int>& section)
{
  Around result;
  for (std::size_t i = 0; i < mesh.elements.size(); ++i)
  {
    const Element& element = mesh.elements[i];
    if (!std::ranges::any_of(nodes_of(element), [&](int node) { return is_on(section, node); })) continue;
    if (is_shell(element.shape)) continue;
    result.elements.push_back(static_cast<int>(i));
    for (Corners& face : faces_of(element))
    {
      std::ranges::sort(face);
      if (std::ranges::any_of(face, [&](int node) { return is_on(section, node); }))
        result.faces[face].push_back(static_cast<int>(i));
    }
  }
  return result;
}

double height(const Mesh& mesh, int element, const Vec3& axis)
{
  double sum = 0;
  const auto nodes = nodes_of(mesh.elements[static_cast<std::size_t>(element)]);
  for (const int node : nodes) sum += dot(mesh.nodes[static_cast<std::size_t>(node)], axis);
  return sum / static_cast<double>(nodes.size());
}

/// The elements at the section on the side that the axis points to: those above its faces, and what is joined to them
/// beside it. Throws Error where the sides meet: one can walk round the section within the material.
std::vector<int> elements_above(const Mesh& mesh, const Bolt& bolt, const std::vector<int>& section)
{
  const auto fail = [&](const std::string& why)
  {
    throw Error("bolt " + bolt.name + ": the section '" + bolt.section + "' " + why +
                ": name a surface across the whole shank, with elements of the shank on both sides");
  };
  const Around found = around(mesh, section);
  const auto place_of = [&](int element)
  { return static_cast<int>(std::ranges::lower_bound(found.elements, element) - found.elements.begin()); };
  DisjointSets patches(found.elements.size()); // joined by faces that are not of the section
  std::vector<std::array<int, 2>> across;      // places of the elements below and above each face of the section
  for (const auto& [face, elements] : found.faces)
  {
    if (elements.size() != 2) continue;
    int low = place_of(elements[0]), high = place_of(elements[1]);
    if (height(mesh, elements[0], bolt.axis) > height(mesh, elements[1], bolt.axis)) std::swap(low, high);
    if (std::ranges::all_of(face, [&](int node) { return is_on(section, node); }))
      across.push_back({low, high});
    else
      patches.join(low, high);
  }
  if (across.empty()) fail("has no face between two solid elements");
  std::set<int> below, above;
  for (const auto& [low, high] : across) below.insert(patches.least(low)), above.insert(patches.least(high));
  if (std::ranges::any_of(below, [&](int patch) { return above.contains(patch); }))
    fail("does not cut the shank through: both of its sides are joined beside it");
  std::vector<int> result;
  for (const int element : found.elements)
    if (const int patch = patches.least(place_of(element)); above.contains(patch))
      result.push_back(element);
    else if (!below.contains(patch))
      fail("has nodes of other solids");
  return result;
}

/// Throws Error for nodes that a contact or tie reads too: it would see one side of the section.
void check_free(const Mesh& mesh, const Scene& scene, const Bolt& bolt, const std::vector<int>& section)
{
  const auto look = [&](const std::string& name, const std::string& user)
  {
    const auto group = mesh.node_groups.find(name);
    if (group == mesh.node_groups.end()) return;
    for (const int node : group->second)
      if (is_on(section, node))
        throw Error("bolt " + bolt.name + ": " + node_text(node, mesh.nodes[static_cast<std::size_t>(node)]) +
                    " of its section is in the " + user + " of '" + name + "' too: cut the shank elsewhere");
  };
  for (const Contact& contact : scene.contacts)
    for (const std::string& name : {contact.rotor, contact.stator}) look(name, "contact");
  for (const Tie& tie : scene.ties)
    for (const std::string& name : {tie.slave, tie.master}) look(name, "tie");
}

std::vector<Cut> cuts_of_section(const Bolt& bolt, const NumberedMesh& numbered, const Scene& scene)
{
  const std::vector<int> section = named_nodes(numbered.mesh, bolt.section, "bolt " + bolt.name);
  check_free(numbered.mesh, scene, bolt, section);
  std::vector<Cut> cuts;
  for (const int element : elements_above(numbered.mesh, bolt, section))
  {
    Cut cut{element_contribution(numbered, scene, static_cast<std::size_t>(element)), {}};
    cut.shift.setZero(static_cast<Eigen::Index>(cut.of.nodal_dofs.size()));
    for (Eigen::Index k = 0; k < cut.shift.size(); ++k)
      if (const PetscInt nodal_dof = cut.of.nodal_dofs[static_cast<std::size_t>(k)];
          is_on(section, static_cast<int>(nodal_dof / 6)))
        cut.shift(k) = -bolt.axis[static_cast<std::size_t>(nodal_dof % 6)];
    cuts.push_back(std::move(cut));
  }
  return cuts;
}

} // namespace

std::vector<Cut> cuts_of(const Bolt& bolt, const NumberedMesh& numbered, const Scene& scene)
{
  if (bolt.beam.empty()) return cuts_of_section(bolt, numbered, scene);
  const auto beam = std::ranges::find(scene.beams, bolt.beam, &Beam::name);
  const auto index = static_cast<std::size_t>(beam - scene.beams.begin());
  const Mesh& mesh = numbered.mesh;
  const std::vector<int>& nodes = mesh.beams[index];
  const Vec3 span = mesh.nodes[static_cast<std::size_t>(nodes[1])] - mesh.nodes[static_cast<std::size_t>(nodes[0])];
  std::vector<Contribution> own = beam_contributions(mesh, scene, index);
  Cut cut{std::move(own.front()), Eigen::VectorXd::Zero(12)};
  for (Eigen::Index c = 0; c < 3; ++c) cut.shift(c) = -span[static_cast<std::size_t>(c)] / norm(span);
  return {cut};
}

} // namespace squeal
