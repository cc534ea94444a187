#pragma once
/// Meshes of boxes and strips for tests, and fields on their degrees of freedom.
#include "squeal/base/error.hpp"
#include "squeal/solid/dofs.hpp"
#include "squeal/solid/structure.hpp"

#include <array>
#include <cmath>
#include <functional>

namespace squeal::test
{

using Cells = std::array<int, 3>;

inline int node_at(Mesh& mesh, const Vec3& x)
{
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    if (norm(mesh.nodes[i] - x) < 1e-9) return static_cast<int>(i);
  mesh.nodes.push_back(x);
  return static_cast<int>(mesh.nodes.size()) - 1;
}

inline void add_to_group(Mesh& mesh, const std::string& name, std::span<const int> nodes)
{
  auto& group = mesh.node_groups[name];
  group.insert(group.end(), nodes.begin(), nodes.end());
  std::sort(group.begin(), group.end());
  group.erase(std::unique(group.begin(), group.end()), group.end());
}

/// 8-node bricks of part `part`; nodes that coincide with the mesh's are shared. The box's faces become surfaces and
/// groups "name:x-", "name:x+", "name:y-" …, all its nodes the group "name".
inline void add_box(Mesh& mesh, const std::string& name, int part, const Vec3& low, const Vec3& high,
                    const Cells& cells)
{
  static constexpr int corner[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                       {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  static constexpr int side[6][4] = {{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4},
                                     {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7}};
  static const char* const side_names[6] = {":x-", ":x+", ":y-", ":y+", ":z-", ":z+"};
  for (int i = 0; i < cells[0]; ++i)
    for (int j = 0; j < cells[1]; ++j)
      for (int k = 0; k < cells[2]; ++k)
      {
        const int cell[3] = {i, j, k};
        Element element{Shape::hex8, part, {}};
        for (std::size_t v = 0; v < 8; ++v)
        {
          Vec3 x{};
          for (std::size_t c = 0; c < 3; ++c) x[c] = low[c] + (high[c] - low[c]) * (cell[c] + corner[v][c]) / cells[c];
          element.nodes[v] = node_at(mesh, x);
        }
        mesh.elements.push_back(element);
        add_to_group(mesh, name, std::span(element.nodes).first(8));
        for (std::size_t s = 0; s < 6; ++s)
        {
          if (cell[s / 2] != (s % 2 == 0 ? 0 : cells[s / 2] - 1)) continue;
          Face face{Shape::quad4, {}};
          for (std::size_t v = 0; v < 4; ++v) face.nodes[v] = element.nodes[static_cast<std::size_t>(side[s][v])];
          mesh.surfaces[name + side_names[s]].push_back(face);
          add_to_group(mesh, name + side_names[s], std::span(face.nodes).first(4));
        }
      }
}

/// A parallelogram origin, origin + a, origin + a + b, origin + b, and its numbers of cells.
struct Strip
{
  Vec3 origin, a, b;
  int along, across;
};

/// 4-node shells over a strip; groups "name" and "name:end" (the edge at origin + a).
inline void add_strip(Mesh& mesh, const std::string& name, int part, const Strip& strip)
{
  const auto at = [&](int i, int j)
  {
    const double x = static_cast<double>(i) / strip.along, y = static_cast<double>(j) / strip.across;
    return node_at(mesh, strip.origin + x * strip.a + y * strip.b);
  };
  for (int i = 0; i < strip.along; ++i)
    for (int j = 0; j < strip.across; ++j)
    {
      Element element{Shape::quad4, part, {}};
      element.nodes = {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)};
      mesh.elements.push_back(element);
      add_to_group(mesh, name, std::span(element.nodes).first(4));
      if (i == strip.along - 1) add_to_group(mesh, name + ":end", std::span(element.nodes).subspan(1, 2));
    }
}

/// Appends a mesh with nodes of its own.
inline void append(Mesh& mesh, const Mesh& other)
{
  const int first = static_cast<int>(mesh.nodes.size());
  mesh.nodes.insert(mesh.nodes.end(), other.nodes.begin(), other.nodes.end());
  for (Element element : other.elements)
  {
    for (int& node : element.nodes) node += first;
    mesh.elements.push_back(element);
  }
  for (const auto& [name, faces] : other.surfaces)
    for (Face face : faces)
    {
      for (int& node : face.nodes) node += first;
      mesh.surfaces[name].push_back(face);
    }
  for (const auto& [name, nodes] : other.node_groups)
    for (const int node : nodes) mesh.node_groups[name].push_back(first + node);
}

/// The nodes of the scene's points, rigid bodies, couplings and beams, as read_mesh adds them.
inline void add_points(Mesh& mesh, const Scene& scene)
{
  const auto add = [&](const std::string& name, const Vec3& at)
  {
    mesh.points[name] = static_cast<int>(mesh.nodes.size());
    mesh.nodes.push_back(at);
  };
  for (const Point& point : scene.points) add(point.name, point.at);
  for (const RigidBody& body : scene.rigid_bodies) add(body.name, body.at);
  for (const Coupling& coupling : scene.couplings) add(coupling.name, coupling.at);
  for (const Beam& beam : scene.beams)
  {
    std::vector<int>& nodes = mesh.beams.emplace_back();
    nodes.push_back(mesh.points.at(beam.from));
    for (int i = 1; i < beam.elements; ++i)
    {
      nodes.push_back(static_cast<int>(mesh.nodes.size()));
      mesh.nodes.emplace_back();
    }
    nodes.push_back(mesh.points.at(beam.to));
  }
  place_points(scene, mesh);
}

struct Built
{
  DofMap dofs;
  Structure structure;
};

inline Built build(const Mesh& mesh, const Scene& scene, MPI_Comm comm)
{
  const Partition partition = partition_mesh(mesh, {}, ranks_of(comm));
  Built built;
  built.dofs = number_dofs(mesh, scene, partition, comm);
  built.structure = assemble({mesh, partition, built.dofs}, scene, comm);
  return built;
}

/// The message that a scene on all ranks is refused with; empty: it is none.
inline std::string message(const Mesh& mesh, const Scene& scene)
{
  try
  {
    build(mesh, scene, PETSC_COMM_WORLD);
  }
  catch (const Error& error)
  {
    return error.what();
  }
  return "";
}

/// A displacement and rotation (x y z rx ry rz) at every place.
using Field = std::function<std::array<double, 6>(const Vec3&)>;

inline Field rigid_motion(const Vec3& translation, const Vec3& rotation)
{
  return [=](const Vec3& x) -> std::array<double, 6>
  {
    const Vec3 u = translation + cross(rotation, x);
    return {u[0], u[1], u[2], rotation[0], rotation[1], rotation[2]};
  };
}

/// Unit translations along x, y, z for k = 0 to 2, unit rotations about them for k = 3 to 5.
inline Field unit_rigid_motion(int k)
{
  Vec3 translation{}, rotation{};
  (k < 3 ? translation : rotation)[static_cast<std::size_t>(k % 3)] = 1;
  return rigid_motion(translation, rotation);
}

/// The field's values on the free degrees of freedom.
inline Owned<Vec> sample(const Structure& structure, const Field& field)
{
  Owned<Vec> u = zeros_like(structure.load);
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(u, &first, &last));
  for (PetscInt dof = first; dof < last; ++dof)
  {
    const PetscInt nodal_dof = structure.names.nodal_dof[dof];
    check(VecSetValue(u, dof, field(structure.names.at[nodal_dof / 6])[nodal_dof % 6], INSERT_VALUES));
  }
  check(VecAssemblyBegin(u));
  check(VecAssemblyEnd(u));
  return u;
}

/// The largest entry of A x.
inline double largest_of_product(Mat A, Vec x)
{
  const Owned<Vec> product = zeros_like(x);
  check(MatMult(A, x, product));
  double largest = 0;
  check(VecNorm(product, NORM_INFINITY, &largest));
  return largest;
}

/// x' A y
inline double form(Mat A, Vec x, Vec y)
{
  Owned<Vec> product = zeros_like(x);
  check(MatMult(A, y, product));
  double value = 0;
  check(VecDot(x, product, &value));
  return value;
}

/// Work of the load on the field.
inline double work(const Structure& structure, const Field& field)
{
  const auto u = sample(structure, field);
  double value = 0;
  check(VecDot(structure.load, u, &value));
  return value;
}

} // namespace squeal::test
