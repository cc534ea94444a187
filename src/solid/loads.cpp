/// The load on the free degrees of freedom. It is T' f: a force is shared equally by its nodes; a pressure p is -p
/// times the integral of N_i n dA, n outward. The share of a fixed degree of freedom is carried by its support.
///
/// Beside T q a nodal degree of freedom may have a motion s that is known: what a support prescribes, or the shortening
/// of a bolt, which the elements on one side of its section see. Its load is -T' K s; that of gravity is T' M a.
#include "contributions.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/mesh/shapes.hpp"

#include <algorithm>
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
  const auto add = [&](const Contribution& of)
  {
    Eigen::VectorXd a = Eigen::VectorXd::Zero(of.M.rows());
    for (Eigen::Index k = 0; k < a.size(); ++k)
    {
      const PetscInt nodal_dof = of.nodal_dofs[static_cast<std::size_t>(k)];
      const bool falls = nodal_dof % 6 < 3 && !coordinates.contains(static_cast<int>(nodal_dof / 6));
      if (falls) a(k) = scene.gravity[static_cast<std::size_t>(nodal_dof % 6)];
    }
    add_vector(load, local_dofs(dofs, of.nodal_dofs), of.M * a - of.K * shift_of(dofs, of.nodal_dofs));
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
      add_vector(result.pull, local_dofs(numbered.dofs, of.nodal_dofs), -force);
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
  double pulled = 0;
  check(VecDot(bolt.pull, u, &pulled));
  return bolt.stiffness * bolt.shortening - pulled + bolt.own;
}

} // namespace squeal
