/// Load T' f: a force is shared equally by its nodes; a pressure p is -p times the integral of N_i n dA, n outward.
/// The share of a fixed degree of freedom is carried by its support.
#include "squeal/solid/structure.hpp"

#include "squeal/mesh/names.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/mesh/shapes.hpp"

namespace squeal
{

namespace
{

void add_force(Vec load, const DofMap& dofs, int node, const Vec3& force)
{
  for (int c = 0; c < 3; ++c)
    for (const DofTerm& term : dofs.terms_of(6 * PetscInt{node} + c))
      check(VecSetValue(load, term.dof, force[c] * term.factor, ADD_VALUES));
}

void add_pressure(Vec load, const DofMap& dofs, const Mesh& mesh, const Face& face, double pressure)
{
  std::vector<Vec3> x;
  for (const int node : nodes_of(face)) x.push_back(mesh.nodes[node]);
  const auto weights = face_weights(face.shape, x);
  for (std::size_t i = 0; i < weights.size(); ++i) add_force(load, dofs, face.nodes[i], -pressure * weights[i]);
}

/// Throws Error for a force of which every part acts on a motion that is held.
void check_acts(const DofMap& dofs, const std::vector<int>& nodes, const Force& force)
{
  if (force.vector == Vec3{}) return;
  for (const int node : nodes)
    for (int c = 0; c < 3; ++c)
      if (force.vector[c] != 0 && !dofs.terms_of(6 * PetscInt{node} + c).empty()) return;
  throw Error("force on " + force.on +
              format(": the vector (%g, %g, %g) N", force.vector[0], force.vector[1], force.vector[2]) +
              " acts on motions only that are held, so it would do nothing: free one of them, or remove the force");
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
      check_acts(dofs, nodes, force);
      for (const int node : nodes) add_force(load, dofs, node, (1. / static_cast<double>(nodes.size())) * force.vector);
    }
    for (const Pressure& pressure : scene.pressures)
      for (const Face& face : named_faces(mesh, pressure.on, "pressure"))
        add_pressure(load, dofs, mesh, face, pressure.value);
  };
  on_rank_zero(comm, add_all);
  check(VecAssemblyBegin(load));
  check(VecAssemblyEnd(load));
  return load;
}

} // namespace squeal
