/// Free degrees of freedom q and the constraints u = T q on the nodal degrees of freedom u.
///
/// Rigid body:       u = u_ref + theta x (x - x_ref); the rotations of a shell node are theta.
/// Tie:              a slave node follows nodes of the master (squeal/mesh/contact_pairs.hpp).
/// Coupling, joint, support in a frame: rows of their own (constraints.hpp).
/// Shell on a solid: a node of both rotates with the solid nodes of the elements that hold it, by
///                   their least-squares rotation
///                   theta = I^-1 sum r_i x u_i,   r_i = x_i - mean x,   I = sum |r_i|^2 1 - r_i r_i^T,
///                   which is exact for rigid motions. The moment of the shell then acts on the solid nodes as the
///                   couple (I^-1 moment) x r_i. I is regular because no solid element is a line.
#include "squeal/solid/dofs.hpp"

#include "constraints.hpp"
#include "squeal/mesh/contact_pairs.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/element.hpp"

#include <algorithm>
#include <numeric>
#include <set>

namespace squeal
{

namespace
{

Vec3 unit(int axis)
{
  Vec3 e{};
  e[axis] = 1;
  return e;
}

/// Sets which components of a point or reference point are free.
void set_components(Constraints& constraints, int node, const Motions& free)
{
  for (int c = 0; c < 6; ++c) constraints.kind_of(node, c) = free[c] ? DofKind::free : DofKind::fixed;
}

/// Returns the components that nodes have, without any support or rigid body.
Constraints unconstrained(const Mesh& mesh, const Scene& scene)
{
  Constraints constraints;
  constraints.kind.assign(6 * mesh.nodes.size(), DofKind::absent);
  for (const Element& element : mesh.elements)
    for (const int node : nodes_of(element))
      for (int c = 0; c < dofs_per_node(element.shape); ++c) constraints.kind_of(node, c) = DofKind::free;
  for (const Point& point : scene.points)
    set_components(constraints, point_node(mesh, point.name, "point"), point.free);
  for (const RigidBody& body : scene.rigid_bodies)
    set_components(constraints, point_node(mesh, body.name, "rigid body"), body.free);
  for (const std::vector<int>& nodes : mesh.beams)
    for (std::size_t i = 1; i + 1 < nodes.size(); ++i) set_components(constraints, nodes[i], every_motion);
  for (std::size_t i = 0; i < mesh.superelements.size(); ++i)
    for (const SuperelementRow& row : mesh.superelements[i])
    {
      DofKind& kind = constraints.kind_of(row.node, row.motion);
      if (row.coordinate) kind = DofKind::free;
      if (kind == DofKind::absent)
        throw Error("superelement " + scene.superelements[i].name + " has the motion " + motion_words[row.motion] +
                    " of a node where the parts have none, " + node_text(row.node, mesh.nodes[row.node]) +
                    ": retain translations alone, or join it to a [[point]] or [[rigid_body]]");
    }
  return constraints;
}

/// Makes the components of a node depend on those of a rigid body's reference point.
void attach_node(Constraints& constraints, const Mesh& mesh, int node, int reference, const Motions& motions)
{
  const Vec3 r = mesh.nodes[node] - mesh.nodes[reference];
  for (int c = 0; c < 6; ++c)
  {
    if (constraints.kind_of(node, c) == DofKind::absent || !motions[static_cast<std::size_t>(c)]) continue;
    std::vector<ConstraintTerm> terms{{6 * PetscInt{reference} + c, 1}};
    for (int axis = 0; axis < 3 && c < 3; ++axis)
      terms.push_back({6 * PetscInt{reference} + 3 + axis, cross(unit(axis), r)[c]});
    make_dependent(constraints, 6 * PetscInt{node} + c, std::move(terms));
  }
}

void add_rigid_bodies(Constraints& constraints, const Mesh& mesh, const std::vector<RigidBody>& bodies)
{
  std::map<int, std::size_t> body_of; // of a node
  for (std::size_t i = 0; i < bodies.size(); ++i)
  {
    const std::string user = "rigid body " + bodies[i].name;
    const int reference = point_node(mesh, bodies[i].name, user);
    for (const std::string& surface : bodies[i].surfaces)
      for (const int node : named_nodes(mesh, surface, user))
      {
        const auto [place, is_new] = body_of.emplace(node, i);
        if (place->second != i)
          throw Error(node_text(node, mesh.nodes[node]) + " belongs to rigid body " + bodies[place->second].name +
                      " and to " + user + "; give each a surface of its own, or make them one body");
        if (is_new) attach_node(constraints, mesh, node, reference, bodies[i].motions);
      }
  }
}

/// Throws Error if a support fixes nothing.
void check_effective(Constraints& constraints, const Mesh& mesh, const Support& support)
{
  for (const int node : named_nodes(mesh, support.on, "support"))
    for (int c = 0; c < 6; ++c)
      if (support.fixed[c] && constraints.kind_of(node, c) != DofKind::absent) return;
  throw Error("support on " + support.on +
              ": none of its nodes has a motion that it fixes (nodes of solids have x y z, of shells rx ry rz too)");
}

/// Supports along the axes of the scene. They come before ties, so that what they hold stays held.
void add_supports(Constraints& constraints, const Mesh& mesh, const Scene& scene)
{
  for (const Support& support : scene.supports) check_effective(constraints, mesh, support);
  for (const Support& support : scene.supports)
    if (is_plain(support)) hold(constraints, mesh, support);
}

/// Whether each node is on a solid.
std::vector<char> nodes_on_solids(const Mesh& mesh)
{
  std::vector<char> on_solid(mesh.nodes.size(), 0);
  for (const Element& element : mesh.elements)
    if (!is_shell(element.shape))
      for (const int node : nodes_of(element)) on_solid[static_cast<std::size_t>(node)] = 1;
  return on_solid;
}

/// Makes tied nodes follow the others. What a support holds stays held, and a mid-side of a rigid body stays on it. The
/// rotation of a joint of shells and solids follows the solids, and so the node itself: its tie is that of a solid.
void add_ties(Constraints& constraints, const Mesh& mesh, const Scene& scene)
{
  const std::vector<char> on_solid = nodes_on_solids(mesh);
  for (const TiedNode& tied : tied_nodes(mesh, scene).nodes)
  {
    const PetscInt first = 6 * PetscInt{tied.node};
    for (int c = 0; c < 3; ++c)
    {
      const DofKind kind = constraints.kind_of(tied.node, c);
      if (kind == DofKind::dependent && tied.tie >= 0)
        throw Error("tie of '" + scene.ties[static_cast<std::size_t>(tied.tie)].slave +
                    "': " + node_text(tied.node, mesh.nodes[tied.node]) +
                    " belongs to a rigid body, which moves it: exchange slave and master");
      if (kind != DofKind::free) continue;
      std::vector<ConstraintTerm> terms;
      for (const auto& [node, weight] : tied.others) terms.push_back({6 * PetscInt{node} + c, weight});
      for (int axis = 0; axis < 3; ++axis)
        if (!on_solid[static_cast<std::size_t>(tied.node)] &&
            constraints.kind_of(tied.node, 3 + axis) != DofKind::absent)
          terms.push_back({first + 3 + axis, cross(unit(axis), tied.arm)[c]});
      make_dependent(constraints, first + c, std::move(terms));
    }
  }
}

/// Returns the solid nodes around each joint, a node that shells and solids share and that has a free rotation.
std::map<int, std::set<int>> solid_nodes_around_joints(Constraints& constraints, const Mesh& mesh)
{
  std::vector<char> is_joint(mesh.nodes.size(), 0);
  for (std::size_t node = 0; node < is_joint.size(); ++node)
    for (int c = 3; c < 6; ++c)
      if (constraints.kind_of(static_cast<int>(node), c) == DofKind::free) is_joint[node] = 1;
  std::map<int, std::set<int>> around;
  for (const Element& element : mesh.elements)
  {
    if (is_shell(element.shape)) continue;
    const auto nodes = nodes_of(element);
    for (const int node : nodes)
      if (is_joint[node]) around[node].insert(nodes.begin(), nodes.end());
  }
  return around;
}

void join_shells_to_solids(Constraints& constraints, const Mesh& mesh)
{
  for (const auto& [node, around] : solid_nodes_around_joints(constraints, mesh))
  {
    std::vector<Weighted> cloud;
    for (const int k : around) cloud.push_back({k});
    auto rows = rows_of_cloud(mesh, cloud, mesh.nodes[node], node_text(node, mesh.nodes[node]));
    for (int motion = 3; motion < 6; ++motion)
      if (constraints.kind_of(node, motion) == DofKind::free)
        make_dependent(constraints, 6 * PetscInt{node} + motion, std::move(rows[static_cast<std::size_t>(motion)]));
  }
}

/// Numbers the free degrees of freedom rank by rank and node by node.
/// Returns the number of each nodal degree of freedom; -1 if it is not free.
std::vector<PetscInt> number_free(const Constraints& constraints, const std::vector<int>& node_rank, DofMap& dofs,
                                  MPI_Comm comm)
{
  const std::vector<DofKind>& kind = constraints.kind;
  std::vector<PetscInt> start(ranks_of(comm) + 1, 0); // of each rank
  for (std::size_t i = 0; i < kind.size(); ++i)
    if (kind[i] == DofKind::free) ++start[node_rank[i / 6] + 1];
  std::partial_sum(start.begin(), start.end(), start.begin());
  dofs.first = start[rank_of(comm)];
  dofs.last = start[rank_of(comm) + 1];
  dofs.size = start.back();
  dofs.names.nodal_dof.resize(dofs.size);
  std::vector<PetscInt> number(kind.size(), -1);
  for (std::size_t i = 0; i < kind.size(); ++i)
    if (kind[i] == DofKind::free)
    {
      number[i] = start[node_rank[i / 6]]++;
      dofs.names.nodal_dof[number[i]] = static_cast<PetscInt>(i);
    }
  return number;
}

/// Sets the rows of T, and the shift.
void set_terms(const Constraints& constraints, const std::vector<PetscInt>& number, DofMap& dofs)
{
  const auto nodal_dofs = static_cast<PetscInt>(constraints.kind.size());
  dofs.offsets.assign(1, 0);
  dofs.offsets.reserve(nodal_dofs + 1);
  for (PetscInt i = 0; i < nodal_dofs; ++i)
  {
    FreeSum sum;
    add_expanded(constraints, i, 1, sum);
    std::map<PetscInt, double> row; // in the order of the free ones
    for (const auto& [nodal_dof, factor] : sum.factors) row[number[nodal_dof]] = factor;
    for (const auto& [dof, factor] : row)
      if (factor != 0) dofs.terms.push_back({dof, factor});
    dofs.offsets.push_back(dofs.terms.size());
    if (!constraints.shift.empty()) dofs.shift.push_back(sum.constant);
  }
}

/// Fills in the bodies and positions of the nodes.
void name_nodes(const Mesh& mesh, const Scene& scene, DofNames& names)
{
  names.at = mesh.nodes;
  names.body.assign(mesh.nodes.size(), 0);
  for (const Part& part : scene.parts) names.bodies.push_back("part " + part.name);
  for (const Element& element : mesh.elements)
    for (const int node : nodes_of(element)) names.body[node] = element.part;
  const auto name_point = [&](const std::string& kind, const std::string& name)
  {
    names.body[mesh.points.at(name)] = static_cast<int>(names.bodies.size());
    names.bodies.push_back(kind + " " + name);
  };
  for (const Point& point : scene.points) name_point("point", point.name);
  for (const RigidBody& body : scene.rigid_bodies) name_point("rigid body", body.name);
  for (const Coupling& coupling : scene.couplings) name_point("coupling", coupling.name);
  for (std::size_t i = 0; i < mesh.beams.size(); ++i)
  {
    for (std::size_t k = 1; k + 1 < mesh.beams[i].size(); ++k)
      names.body[static_cast<std::size_t>(mesh.beams[i][k])] = static_cast<int>(names.bodies.size());
    names.bodies.push_back("beam " + scene.beams[i].name);
  }
  for (std::size_t i = 0; i < mesh.superelements.size(); ++i)
  {
    for (const SuperelementRow& row : mesh.superelements[i])
      if (row.coordinate) names.body[row.node] = static_cast<int>(names.bodies.size());
    names.bodies.push_back("superelement " + scene.superelements[i].name);
  }
}

} // namespace

std::string describe(const DofNames& names, PetscInt dof)
{
  if (names.nodal_dof.empty())
  {
    const std::string row = "dof " + std::to_string(names.file_rows.empty() ? dof : names.file_rows.at(dof));
    if (names.file_motions.empty() || names.file_motions.at(dof).motion < 0) return row;
    const auto [node, motion] = names.file_motions[dof];
    return row + " (node " + std::to_string(node) + ", " + motion_words[motion] + ")";
  }
  const PetscInt nodal_dof = names.nodal_dof.at(dof);
  const int node = static_cast<int>(nodal_dof / 6);
  return names.bodies[names.body[node]] + ", " + node_text(node, names.at[node]) + ", direction " +
         motion_words[nodal_dof % 6];
}

std::span<const DofTerm> DofMap::terms_of(PetscInt nodal_dof) const
{
  const std::size_t begin = offsets[nodal_dof], end = offsets[nodal_dof + 1];
  return std::span(terms).subspan(begin, end - begin);
}

DofMap number_dofs(const Mesh& mesh, const Scene& scene, const Partition& partition, MPI_Comm comm)
{
  Constraints constraints = unconstrained(mesh, scene);
  add_rigid_bodies(constraints, mesh, scene.rigid_bodies);
  add_supports(constraints, mesh, scene);
  add_couplings(constraints, mesh, scene.couplings);
  add_ties(constraints, mesh, scene);
  join_shells_to_solids(constraints, mesh);
  add_rows(constraints, mesh, scene);
  DofMap dofs;
  const auto number = number_free(constraints, partition.node_rank, dofs, comm);
  if (dofs.size == 0) throw Error("nothing is free to move: supports and points hold every motion of the scene");
  set_terms(constraints, number, dofs);
  name_nodes(mesh, scene, dofs.names);
  return dofs;
}

} // namespace squeal
