/// The load on the free degrees of freedom. It is T' f: a force is shared equally by its nodes; a pressure p is -p
/// times the integral of N_i n dA, n outward. The share of a fixed degree of freedom is carried by its support.
///
/// Beside T q a nodal degree of freedom may have a known motion s. A support prescribes it, or it is a bolt's
/// shortening, which the elements on one side of its section see. Its load is -T' K s; that of gravity is T' M a.
#include "contributions.hpp"
#include "squeal/base/error.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <boost/pending/disjoint_sets.hpp>
#include <map>
#include <set>

namespace squeal
{

namespace
{

/// `first`: 0 for a force, 3 for a moment.
void add_force(Vec load, const DofMap& dofs, PetscInt first, const Vec3& force)
{
  for (PetscInt c = 0; c < 3; ++c)
    for (const DofTerm& term : dofs.terms_of(first + c))
      check(VecSetValue(load, term.dof, force[static_cast<std::size_t>(c)] * term.factor, ADD_VALUES));
}

void add_pressure(Vec load, const DofMap& dofs, const Mesh& mesh, const Face& face, double pressure)
{
  const auto weights = face_weights(face.shape, positions_of(mesh, nodes_of(face)));
  for (std::size_t i = 0; i < weights.size(); ++i)
    add_force(load, dofs, 6 * PetscInt{face.nodes[i]}, -pressure * weights[i]);
}

/// Throws Error for a force or moment of which every part acts on a motion that is held, or that no node has. `first`:
/// 0 for a force, 3 for a moment.
void check_acts(const DofMap& dofs, const std::vector<int>& nodes, const std::string& on, int first, const Vec3& vector)
{
  if (vector == Vec3{}) return;
  for (const int node : nodes)
    for (int c = 0; c < 3; ++c)
      if (vector[c] != 0 && !dofs.terms_of(6 * PetscInt{node} + first + c).empty()) return;
  throw Error("force on " + on +
              format(": the %s (%g, %g, %g) %s", first == 0 ? "vector" : "moment", vector[0], vector[1], vector[2],
                     first == 0 ? "N" : "N m") +
              " acts on motions only that are held, so it would do nothing: free one of them, or remove the force" +
              (first == 0 ? "" : "; nodes of solids do not rotate: let a [[coupling]] or [[rigid_body]] take it"));
}

/// Nodes that carry modal coordinates of superelements, which gravity does not act on.
std::set<int> coordinate_nodes(const Mesh& mesh)
{
  std::set<int> nodes;
  for (const std::vector<SuperelementRow>& rows : mesh.superelements)
    for (const SuperelementRow& row : rows)
      if (row.coordinate) nodes.insert(row.node);
  return nodes;
}

Eigen::VectorXd shift_of(const DofMap& dofs, const std::vector<PetscInt>& nodal_dofs)
{
  Eigen::VectorXd shift(static_cast<Eigen::Index>(nodal_dofs.size()));
  for (Eigen::Index k = 0; k < shift.size(); ++k) shift(k) = dofs.shift_of(nodal_dofs[static_cast<std::size_t>(k)]);
  return shift;
}

/// Throws Error for a part that spins and that a support moves.
void check_moved(const NumberedMesh& numbered, const Scene& scene)
{
  for (const Element& element : numbered.mesh.elements)
    if (const Part& part = scene.parts[static_cast<std::size_t>(element.part)];
        part.rotation && !shift_of(numbered.dofs, nodal_dofs_of(element)).isZero(0))
      throw Error("part " + part.name + " spins, so no support can move its nodes: let the support hold them");
}

/// Adds T' (M a - K s): gravity on everything that has mass, and what supports move. Collective.
void add_gravity_and_shift(Vec load, const NumberedMesh& numbered, const Scene& scene, MPI_Comm comm)
{
  const std::set<int> coordinates = coordinate_nodes(numbered.mesh);
  const DofMap& dofs = numbered.dofs;
  if (!dofs.shift.empty()) on_rank_zero(comm, [&] { check_moved(numbered, scene); });
  const auto add = [&](const Contribution& of, AddedRows added)
  {
    Eigen::VectorXd a = Eigen::VectorXd::Zero(of.M.rows());
    for (Eigen::Index k = 0; k < a.size(); ++k)
    {
      const PetscInt nodal_dof = of.nodal_dofs[static_cast<std::size_t>(k)];
      const bool falls = nodal_dof % 6 < 3 && !coordinates.contains(static_cast<int>(nodal_dof / 6));
      if (falls) a(k) = scene.gravity[static_cast<std::size_t>(nodal_dof % 6)];
    }
    add_vector(load, local_dofs(dofs, of.nodal_dofs, added), of.M * a - of.K * shift_of(dofs, of.nodal_dofs));
  };
  if (scene.gravity != Vec3{} || !dofs.shift.empty()) for_each_contribution(numbered, scene, comm, add);
}

/// The section of a bolt. Collective.
TightBolt bolt_of(const Bolt& bolt, const NumberedMesh& numbered, const Scene& scene, Vec layout)
{
  TightBolt result;
  result.name = bolt.name;
  result.tension = bolt.tension;
  result.pull = zeros_like(layout);
  const MPI_Comm comm = comm_of(layout);
  const auto add_cuts = [&]
  {
    for (const auto& [of, shift] : cuts_of(bolt, numbered, scene))
    {
      const Eigen::VectorXd force = of.K * shift;
      add_vector(result.pull, local_dofs(numbered.dofs, of.nodal_dofs, AddedRows::all), -force);
      result.stiffness += shift.dot(force);
      result.own += force.dot(shift_of(numbered.dofs, of.nodal_dofs));
    }
  };
  on_rank_zero(comm, add_cuts);
  finish(result.pull);
  for (double* number : {&result.stiffness, &result.own}) MPI_Bcast(number, 1, MPI_DOUBLE, 0, comm);
  return result;
}

} // namespace

Owned<Vec> assemble_load(const Mesh& mesh, const Scene& scene, const DofMap& dofs, MPI_Comm comm)
{
  Owned<Vec> load;
  check(VecCreate(comm, load.put()));
  check(VecSetSizes(load, dofs.last - dofs.first, dofs.size));
  check(VecSetType(load, VECSTANDARD));
  const auto add_all = [&]
  {
    for (const Force& force : scene.forces)
    {
      const auto nodes = named_nodes(mesh, force.on, "force");
      const double share = 1. / static_cast<double>(nodes.size());
      for (const auto& [first, vector] : {std::pair{0, force.vector}, std::pair{3, force.moment}})
      {
        check_acts(dofs, nodes, force.on, first, vector);
        for (const int node : nodes) add_force(load, dofs, 6 * PetscInt{node} + first, share * vector);
      }
    }
    for (const Pressure& pressure : scene.pressures)
      for (const Face& face : named_faces(mesh, pressure.on, "pressure"))
        add_pressure(load, dofs, mesh, face, pressure.value);
  };
  on_rank_zero(comm, add_all);
  finish(load);
  return load;
}

void assemble_preload(Structure& structure, const NumberedMesh& numbered, const Scene& scene, MPI_Comm comm)
{
  structure.preload = {};
  structure.bolts.clear();
  if (!has_preload(scene)) return;
  structure.preload = zeros_like(structure.load);
  add_gravity_and_shift(structure.preload, numbered, scene, comm);
  finish(structure.preload);
  check(VecAXPY(structure.load, 1, structure.preload));
  for (const Bolt& bolt : scene.bolts) structure.bolts.push_back(bolt_of(bolt, numbered, scene, structure.load));
}

double tension_of(const TightBolt& bolt, Vec u)
{
  return bolt.stiffness * bolt.shortening - dot(bolt.pull, u) + bolt.own;
}

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
  boost::disjoint_sets_with_storage<> patches(found.elements.size()); // joined by faces that are not of the section
  std::vector<std::array<int, 2>> across; // places of the elements below and above each face of the section
  for (const auto& [face, elements] : found.faces)
  {
    if (elements.size() != 2) continue;
    int low = place_of(elements[0]), high = place_of(elements[1]);
    if (height(mesh, elements[0], bolt.axis) > height(mesh, elements[1], bolt.axis)) std::swap(low, high);
    if (std::ranges::all_of(face, [&](int node) { return is_on(section, node); }))
      across.push_back({low, high});
    else
      patches.union_set(low, high);
  }
  if (across.empty()) fail("has no face between two solid elements");
  std::set<std::size_t> below, above;
  for (const auto& [low, high] : across) below.insert(patches.find_set(low)), above.insert(patches.find_set(high));
  if (std::ranges::any_of(below, [&](std::size_t patch) { return above.contains(patch); }))
    fail("does not cut the shank through: both of its sides are joined beside it");
  std::vector<int> result;
  for (const int element : found.elements)
    if (const std::size_t patch = patches.find_set(place_of(element)); above.contains(patch))
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
