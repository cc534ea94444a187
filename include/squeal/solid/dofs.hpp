#pragma once
/// Free degrees of freedom q and constraints u = T q + shift on nodal degrees of freedom u (src/README.md,
/// sections 1.4, 1.6). Nodal degree of freedom 6 * node + c is component c of a node, c = 0..5 for x y z rx ry rz.
#include "squeal/base/petsc.hpp"
#include "squeal/mesh/contact_pairs.hpp"
#include "squeal/mesh/row_motions.hpp"

#include <span>
#include <string>
#include <vector>

namespace squeal
{

/// The names of free degrees of freedom. Texts are made on demand only, since a model has many degrees of freedom.
struct DofNames
{
  // Names of a mesh:
  std::vector<std::string> bodies; // "part disc", "point tip", "rigid body carrier"
  std::vector<int> body;           // index in `bodies` of each node
  std::vector<Vec3> at;            // [m] position of each node
  std::vector<PetscInt> nodal_dof; // of each free degree of freedom; empty on a matrix scene
  // On a matrix scene, of each free degree of freedom:
  std::vector<PetscInt> file_rows;      // row of the files
  std::vector<NodeMotion> file_motions; // empty without dofs.txt
};

/// Returns "part disc, node 12 at (x, y, z), direction ry", or "dof 12 (node 1017, x)" on a matrix scene. Not
/// collective.
std::string describe(const DofNames& names, PetscInt dof);

/// An entry of a row of T.
struct DofTerm
{
  PetscInt dof = 0;  // free degree of freedom
  double factor = 0; // [-, m]
};

/// The rows of T of the nodes of a mesh. Both nodes of a contact pair have their degrees of freedom on one rank.
struct DofMap
{
  PetscInt size = 0;                // number of free degrees of freedom on all ranks
  PetscInt first = 0;               // this rank owns first to last - 1
  PetscInt last = 0;                // end of this rank's range
  std::vector<std::size_t> offsets; // of each nodal degree of freedom in `terms`, and the end
  std::vector<DofTerm> terms;
  DofNames names;
  std::vector<double> shift{}; // [m, rad] of each nodal degree of freedom beside T q: by supports; empty: none

  /// The motion of a nodal degree of freedom by supports, whatever q is [m, rad].
  double shift_of(PetscInt nodal_dof) const { return shift.empty() ? 0 : shift[static_cast<std::size_t>(nodal_dof)]; }

  /// Row of a nodal degree of freedom. It is empty where the motion is fixed or the node does not have it.
  std::span<const DofTerm> terms_of(PetscInt nodal_dof) const;
};

/// Numbers the free degrees of freedom of a whole mesh and eliminates supports and rigid bodies. Not collective: `comm`
/// says which rank this is. The rotation of a node that shells and solids share follows the least-squares rotation of
/// the solid nodes around it. The moments of the shell then act on the solid as couples. Throws Error for a support or
/// rigid body that contradicts another, and if nothing is free.
DofMap number_dofs(const Mesh& mesh, const Scene& scene, const Partition& partition, MPI_Comm comm);

/// A mesh with its numbering. Every rank has the whole of it.
struct NumberedMesh
{
  Mesh mesh;
  Partition partition{};
  DofMap dofs{};
};

} // namespace squeal
