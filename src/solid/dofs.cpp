/// Free degrees of freedom and the constraints u = T q.
///
/// Rigid body:       u = u_ref + theta x (x - x_ref), and a shell node's rotations are theta.
/// Shell on a solid: a node of both turns with the solid nodes around it (those of the solid elements that hold it),
///                   theta = I^-1 sum r_i x u_i,   r_i = x_i - mean x,   I = sum |r_i|^2 1 - r_i r_i^T,
///                   their least-squares rotation, exact for rigid motions; by virtue of u = T q the shell's moment
///                   acts on them as the couple r_i x (I^-1 moment). I is regular because no solid element is a line.
#include "squeal/mesh/names.hpp"
#include "squeal/mesh/shapes.hpp"
#include "squeal/mesh/vector.hpp"
#include "squeal/solid/element.hpp"
#include "squeal/solid/structure.hpp"

#include <algorithm>
#include <Eigen/Dense>
#include <numeric>
#include <unordered_map>

namespace squeal
{

namespace
{

enum class Kind : char
{
  absent, // the node has no such motion
  free,
  held,
  slave,
};

struct MotionTerm
{
  int motion = 0; // 6 * node + component
  double factor = 0;
};

struct MotionTable
{
  std::vector<Kind> kind; // of each motion
  std::unordered_map<int, std::vector<MotionTerm>> slaves;
  std::unordered_map<int, int> body_of; // rigid body of a slave node
};

const char* const direction_names[] = {"x", "y", "z", "rx", "ry", "rz"};

Vec3 unit(int axis)
{
  Vec3 e{};
  e[static_cast<std::size_t>(axis)] = 1;
  return e;
}

Kind& kind_of(MotionTable& table, int node, int component)
{
  return table.kind[static_cast<std::size_t>(6 * node + component)];
}

void give_motions(MotionTable& table, int node, const Motions& free)
{
  for (int c = 0; c < 6; ++c) kind_of(table, node, c) = free[static_cast<std::size_t>(c)] ? Kind::free : Kind::held;
}

MotionTable all_motions(const Mesh& mesh, const Scene& scene)
{
  MotionTable table;
  table.kind.assign(6 * mesh.nodes.size(), Kind::absent);
  for (const Element& element : mesh.elements)
    for (int k = 0; k < node_count(element.shape); ++k)
      for (int c = 0; c < dofs_per_node(element.shape); ++c)
        kind_of(table, element.nodes[static_cast<std::size_t>(k)], c) = Kind::free;
  for (const Point& point : scene.points) give_motions(table, point_node(mesh, point.name, "point"), point.free);
  for (const RigidBody& body : scene.rigid_bodies)
    give_motions(table, point_node(mesh, body.name, "rigid body"), body.free);
  return table;
}

void make_slave(MotionTable& table, int motion, std::vector<MotionTerm> terms)
{
  table.kind[static_cast<std::size_t>(motion)] = Kind::slave;
  table.slaves[motion] = std::move(terms);
}

void tie_node(MotionTable& table, const Mesh& mesh, int node, int reference)
{
  const Vec3 r = mesh.nodes[static_cast<std::size_t>(node)] - mesh.nodes[static_cast<std::size_t>(reference)];
  for (int c = 0; c < 6; ++c)
  {
    if (kind_of(table, node, c) == Kind::absent) continue;
    std::vector<MotionTerm> terms{{6 * reference + c, 1}};
    for (int axis = 0; axis < 3 && c < 3; ++axis)
      terms.push_back({6 * reference + 3 + axis, cross(unit(axis), r)[static_cast<std::size_t>(c)]});
    make_slave(table, 6 * node + c, std::move(terms));
  }
}

void tie_rigid_bodies(MotionTable& table, const Mesh& mesh, const std::vector<RigidBody>& bodies)
{
  for (std::size_t i = 0; i < bodies.size(); ++i)
  {
    const std::string asker = "rigid body " + bodies[i].name;
    const int reference = point_node(mesh, bodies[i].name, asker);
    for (const std::string& surface : bodies[i].surfaces)
      for (const int node : named_nodes(mesh, surface, asker))
      {
        const auto [place, is_new] = table.body_of.emplace(node, static_cast<int>(i));
        const auto other = static_cast<std::size_t>(place->second);
        if (other != i)
          throw Error(node_text(node, mesh.nodes[node]) + " belongs to rigid body " + bodies[other].name + " and to " +
                      asker + "; give each a surface of its own, or make them one body");
        if (is_new) tie_node(table, mesh, node, reference);
      }
  }
}

/// A support on a rigid body's node is fine where the body holds still anyway.
void check_held_slave(const MotionTable& table, const Mesh& mesh, const Scene& scene, const std::string& support,
                      int motion)
{
  const auto slave = table.slaves.find(motion);
  if (slave == table.slaves.end()) return;
  for (const MotionTerm& term : slave->second)
    if (term.factor != 0 && table.kind[static_cast<std::size_t>(term.motion)] == Kind::free)
      throw Error(node_text(motion / 6, mesh.nodes[motion / 6]) + ": the support on " + support + " holds its " +
                  direction_names[motion % 6] + ", which rigid body " +
                  scene.rigid_bodies[static_cast<std::size_t>(table.body_of.at(motion / 6))].name + " moves by its " +
                  direction_names[term.motion % 6] +
                  "; take the node out of the support, or put the support on the body");
}

void check_holds_something(MotionTable& table, const Mesh& mesh, const Support& support)
{
  for (const int node : named_nodes(mesh, support.on, "support"))
    for (int c = 0; c < 6; ++c)
      if (support.fixed[static_cast<std::size_t>(c)] && kind_of(table, node, c) != Kind::absent) return;
  throw Error("support on " + support.on +
              ": none of its nodes has a motion that it fixes (nodes of solids have x y z, of shells rx ry rz too)");
}

void hold_supports(MotionTable& table, const Mesh& mesh, const Scene& scene)
{
  const auto each = [&](auto work)
  {
    for (const Support& support : scene.supports)
      for (const int node : named_nodes(mesh, support.on, "support"))
        for (int c = 0; c < 6; ++c)
          if (support.fixed[static_cast<std::size_t>(c)]) work(support.on, 6 * node + c);
  };
  for (const Support& support : scene.supports) check_holds_something(table, mesh, support);
  each(
      [&](const std::string&, int motion)
      {
        Kind& kind = table.kind[static_cast<std::size_t>(motion)];
        if (kind == Kind::free) kind = Kind::held;
      });
  each([&](const std::string& support, int motion) { check_held_slave(table, mesh, scene, support, motion); });
}

/// The solid nodes around every node that a shell and a solid share and whose rotations are still its own.
std::map<int, std::vector<int>> solid_nodes_around_joints(MotionTable& table, const Mesh& mesh)
{
  std::vector<char> on_solid(mesh.nodes.size(), 0);
  for (const Element& element : mesh.elements)
    if (!is_shell(element.shape))
      for (int k = 0; k < node_count(element.shape); ++k)
        on_solid[static_cast<std::size_t>(element.nodes[static_cast<std::size_t>(k)])] = 1;
  std::map<int, std::vector<int>> around;
  const auto is_joint = [&](int node)
  {
    bool turns = false;
    for (int c = 3; c < 6; ++c) turns = turns || kind_of(table, node, c) == Kind::free;
    return turns && on_solid[static_cast<std::size_t>(node)];
  };
  for (const Element& element : mesh.elements)
  {
    if (is_shell(element.shape)) continue;
    const std::span nodes(element.nodes.data(), static_cast<std::size_t>(node_count(element.shape)));
    for (const int node : nodes)
      if (is_joint(node)) around[node].insert(around[node].end(), nodes.begin(), nodes.end());
  }
  for (auto& [node, nodes] : around)
  {
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  }
  return around;
}

void join_shells_to_solids(MotionTable& table, const Mesh& mesh)
{
  const auto position = [&](int node) { return Eigen::Vector3d(mesh.nodes[static_cast<std::size_t>(node)].data()); };
  for (const auto& [node, around] : solid_nodes_around_joints(table, mesh))
  {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const int k : around) mean += position(k) / static_cast<double>(around.size());
    Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
    for (const int k : around)
    {
      const Eigen::Vector3d r = position(k) - mean;
      inertia += r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose();
    }
    const Eigen::Matrix3d turn = inertia.inverse();
    for (int axis = 0; axis < 3; ++axis)
    {
      if (kind_of(table, node, 3 + axis) != Kind::free) continue;
      std::vector<MotionTerm> terms;
      for (const int k : around)
        for (int c = 0; c < 3; ++c)
          terms.push_back({6 * k + c, turn.row(axis).dot((position(k) - mean).cross(Eigen::Vector3d::Unit(c)))});
      make_slave(table, 6 * node + 3 + axis, std::move(terms));
    }
  }
}

/// Free motions, rank after rank, node after node.
std::vector<PetscInt> number_free(const MotionTable& table, const std::vector<int>& node_rank, DofMap& dofs,
                                  MPI_Comm comm)
{
  std::vector<PetscInt> start(static_cast<std::size_t>(ranks_of(comm)) + 1, 0);
  const auto rank_of_motion = [&](std::size_t motion) { return static_cast<std::size_t>(node_rank[motion / 6]); };
  for (std::size_t motion = 0; motion < table.kind.size(); ++motion)
    if (table.kind[motion] == Kind::free) ++start[rank_of_motion(motion) + 1];
  std::partial_sum(start.begin(), start.end(), start.begin());
  const auto rank = static_cast<std::size_t>(rank_of(comm));
  dofs.first = start[rank];
  dofs.last = start[rank + 1];
  dofs.size = start.back();
  dofs.names.motion.resize(static_cast<std::size_t>(dofs.size));
  std::vector<PetscInt> number(table.kind.size(), -1);
  for (std::size_t motion = 0; motion < table.kind.size(); ++motion)
    if (table.kind[motion] == Kind::free)
    {
      number[motion] = start[rank_of_motion(motion)]++;
      dofs.names.motion[static_cast<std::size_t>(number[motion])] = static_cast<int>(motion);
    }
  return number;
}

/// A slave may follow another slave (a joint's rotation follows solid nodes of a rigid body), never itself.
void add_terms(const MotionTable& table, const std::vector<PetscInt>& number, int motion, double factor,
               std::map<PetscInt, double>& sum)
{
  const Kind kind = table.kind[static_cast<std::size_t>(motion)];
  if (kind == Kind::free) sum[number[static_cast<std::size_t>(motion)]] += factor;
  if (kind != Kind::slave) return;
  for (const MotionTerm& term : table.slaves.at(motion))
    if (term.factor != 0) add_terms(table, number, term.motion, factor * term.factor, sum);
}

void resolve_terms(const MotionTable& table, const std::vector<PetscInt>& number, DofMap& dofs)
{
  dofs.offsets.assign(1, 0);
  dofs.offsets.reserve(table.kind.size() + 1);
  for (std::size_t motion = 0; motion < table.kind.size(); ++motion)
  {
    if (table.kind[motion] == Kind::free)
      dofs.terms.push_back({number[motion], 1});
    else if (table.kind[motion] == Kind::slave)
    {
      std::map<PetscInt, double> sum;
      add_terms(table, number, static_cast<int>(motion), 1, sum);
      for (const auto& [dof, factor] : sum)
        if (factor != 0) dofs.terms.push_back({dof, factor});
    }
    dofs.offsets.push_back(static_cast<PetscInt>(dofs.terms.size()));
  }
}

void name_nodes(const Mesh& mesh, const Scene& scene, DofNames& names)
{
  names.at = mesh.nodes;
  names.body.assign(mesh.nodes.size(), 0);
  for (const Part& part : scene.parts) names.bodies.push_back("part " + part.name);
  for (const Element& element : mesh.elements)
    for (int k = 0; k < node_count(element.shape); ++k)
      names.body[static_cast<std::size_t>(element.nodes[static_cast<std::size_t>(k)])] = element.part;
  const auto name_point = [&](const std::string& kind, const std::string& name)
  {
    names.body[static_cast<std::size_t>(mesh.points.at(name))] = static_cast<int>(names.bodies.size());
    names.bodies.push_back(kind + " " + name);
  };
  for (const Point& point : scene.points) name_point("point", point.name);
  for (const RigidBody& body : scene.rigid_bodies) name_point("rigid body", body.name);
}

} // namespace

std::span<const DofTerm> DofMap::of(int node, int component) const
{
  const auto motion = static_cast<std::size_t>(6 * node + component);
  const auto begin = static_cast<std::size_t>(offsets[motion]), end = static_cast<std::size_t>(offsets[motion + 1]);
  return {terms.data() + begin, end - begin};
}

DofMap number_dofs(const Mesh& mesh, const Scene& scene, const Partition& partition, MPI_Comm comm)
{
  MotionTable table = all_motions(mesh, scene);
  tie_rigid_bodies(table, mesh, scene.rigid_bodies);
  hold_supports(table, mesh, scene);
  join_shells_to_solids(table, mesh);
  DofMap dofs;
  const auto number = number_free(table, partition.node_rank, dofs, comm);
  if (dofs.size == 0) throw Error("nothing is free to move: supports and points hold every motion of the scene");
  resolve_terms(table, number, dofs);
  name_nodes(mesh, scene, dofs.names);
  return dofs;
}

} // namespace squeal
