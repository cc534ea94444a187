#pragma once
/// From mesh to matrices: degrees of freedom and constraints u_nodes = T u, and M, C, K, load on the free ones.
///     M u'' + C u' + K u = load + contact,   C = sum of alpha M + beta K by part, plus dashpots.
#include "squeal/base/petsc.hpp"
#include "squeal/mesh/mesh.hpp"

#include <span>
#include <string>
#include <vector>

namespace squeal
{

struct DofTerm
{
  PetscInt dof = 0;
  double factor = 0;
};

/// What each free degree of freedom is, for messages: told when asked, since a model has a quarter million of them.
struct DofNames
{
  std::vector<std::string> bodies; // "part disc", "point tip", "rigid body carrier"
  std::vector<int> body;           // of each node
  std::vector<Vec3> at;            // [m] of each node
  std::vector<int> motion;         // of each free dof: 6 * node + component; empty on a matrix scene
};

/// "part disc, node 12 at (x, y, z), direction ry", or "dof 12" on a matrix scene.
std::string describe(const DofNames& names, PetscInt dof);

/// u of node k, component c (0..2 translations, 3..5 rotations) = sum of factor * u[dof]; no terms: held still, or the
/// node has no such motion. The same on every rank; a pair of contact nodes and its degrees of freedom share a rank.
struct DofMap
{
  PetscInt size = 0;             // free degrees of freedom of all ranks
  PetscInt first = 0, last = 0;  // this rank owns [first, last)
  std::vector<PetscInt> offsets; // 6 * nodes + 1, into terms
  std::vector<DofTerm> terms;
  DofNames names;

  std::span<const DofTerm> of(int node, int component) const;
};

/// Supports and rigid bodies are eliminated exactly. A node shared by shells and solids: its rotation follows the
/// least-squares rotation of the solid nodes around it, so that the shell's moments enter the solid as couples.
/// Errors: a support or rigid body that contradicts another (which node, which two), nothing free.
DofMap number_dofs(const Mesh& mesh, const Scene& scene, const Partition& partition, MPI_Comm comm);

/// AIJ matrices of one common non-zero pattern, symmetric flags set.
struct Structure
{
  Owned<Mat> M, C, K; // [kg, N s/m, N/m]
  Owned<Vec> load;    // [N]
  long elements = 0;
  DofNames names;
};

Structure assemble(const Mesh& mesh, const Scene& scene, const Partition& partition, const DofMap& dofs, MPI_Comm comm);

/// M.petsc C.petsc K.petsc F.petsc of a folder. Errors: a file missing, truncated or not PETSc binary, sizes that
/// disagree (both named), entries that are not finite, M or K not symmetric.
Structure read_structure(const std::filesystem::path& folder, MPI_Comm comm);

/// A row of the probe matrix per probe: probe value = row . u.
Owned<Mat> probe_rows(const std::vector<Probe>& probes, const Mesh& mesh, const DofMap& dofs, MPI_Comm comm);

/// Probes of a matrix scene: "dof:N".
Owned<Mat> probe_rows(const std::vector<Probe>& probes, const Structure& structure, MPI_Comm comm);

} // namespace squeal
