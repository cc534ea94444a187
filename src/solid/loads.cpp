/// Load T^T f: a force is shared equally by the nodes it acts on; a pressure p acts as -p times the integral of N_i n
/// dA, n outward. What acts on a held motion goes into the support.
#include "loads.hpp"

#include "squeal/mesh/names.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/mesh/shapes.hpp"
#include "squeal/mesh/vector.hpp"
#include "squeal/solid/element.hpp"

namespace squeal
{

namespace
{

void add_force(Vec load, const DofMap& dofs, int node, const Vec3& force)
{
  for (int c = 0; c < 3; ++c)
    for (const DofTerm& term : dofs.of(node, c))
      check(VecSetValue(load, term.dof, force[static_cast<std::size_t>(c)] * term.factor, ADD_VALUES));
}

void add_pressure(Vec load, const DofMap& dofs, const Mesh& mesh, const Face& face, double pressure)
{
  const auto count = static_cast<std::size_t>(node_count(face.shape));
  std::vector<Vec3> x;
  for (std::size_t k = 0; k < count; ++k) x.push_back(mesh.nodes[static_cast<std::size_t>(face.nodes[k])]);
  const auto weights = face_weights(face.shape, x);
  for (std::size_t k = 0; k < count; ++k) add_force(load, dofs, face.nodes[k], -pressure * weights[k]);
}

} // namespace

Owned<Vec> assemble_load(const Mesh& mesh, const Scene& scene, const Partition& partition, const DofMap& dofs,
                         MPI_Comm comm)
{
  const int rank = rank_of(comm);
  Owned<Vec> load;
  check(VecCreate(comm, load.put()));
  check(VecSetSizes(load, dofs.last - dofs.first, dofs.size));
  check(VecSetType(load, VECSTANDARD));
  for (const Force& force : scene.forces)
  {
    const auto nodes = named_nodes(mesh, force.on, "force");
    if (rank != 0) continue;
    for (const int node : nodes) add_force(load, dofs, node, (1. / static_cast<double>(nodes.size())) * force.vector);
  }
  for (const Pressure& pressure : scene.pressures)
    for (const Face& face : named_faces(mesh, pressure.on, "pressure"))
      if (partition.node_rank[static_cast<std::size_t>(face.nodes[0])] == rank)
        add_pressure(load, dofs, mesh, face, pressure.value);
  check(VecAssemblyBegin(load));
  check(VecAssemblyEnd(load));
  return load;
}

} // namespace squeal
