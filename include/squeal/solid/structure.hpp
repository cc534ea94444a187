#pragma once
/// From the mesh to the equations of motion of the free degrees of freedom q (src/README.md, section 1.4):
///     M q'' + C q' + K q = load + contact forces,   C = sum of alpha M + beta K of each part, and dashpots.
/// Supports and rigid bodies are exact constraints (squeal/solid/dofs.hpp).
#include "squeal/solid/dofs.hpp"

#include <cstdint>

namespace squeal
{

/// The end of a step of the load path. What it changes rises or falls in proportion from the end of the step before.
struct PathStep
{
  std::string name;
  Owned<Vec> load;                  // [N, N m]
  double driven_friction = 1;       // [-] on the coefficients of driven pairs
  std::vector<std::size_t> bolts{}; // of Structure::bolts, that have their tension at the end
};

/// A bolt as its shank's section sees it: its tension is stiffness * shortening - pull . q + own.
struct TightBolt
{
  std::string name;
  double tension = 0;    // [N] that it is tightened to
  Owned<Vec> pull;       // [N/m] load on q by a unit of shortening
  double stiffness = 0;  // [N/m] of what the section cuts
  double own = 0;        // [N] by prescribed displacements alone
  double shortening = 0; // [m] found by `tighten`; the load of the structure and of its path has its part
};

/// The matrices have one common non-zero pattern and are marked as symmetric.
struct Structure
{
  Owned<Mat> M;          // [kg, kg m, kg m2]
  Owned<Mat> C;          // [N s/m, N s, N m s]
  Owned<Mat> K;          // [N/m, N, N m]
  Owned<Mat> G;          // [N s/m] skew, gyroscopic; null: none
  Owned<Mat> H;          // [N/m] skew, circulatory; null: none
  Owned<Mat> K_loss;     // [N/m] sum of eta K of the parts with a loss factor eta; null: none
  double loss_omega = 0; // [rad/s] C holds K_loss/loss_omega; 0: none of it
  Owned<Vec> load;       // [N, N m] all of it
  Owned<Vec> preload;    // [N, N m] of it, what no load factor scales: gravity, prescribed motions, bolts; null
  std::vector<TightBolt> bolts{};
  std::vector<PathStep> path{}; // the way to it, which undriven pairs depend on; empty: in proportion, sliding
  std::int64_t elements = 0;    // number of elements; 0 on a matrix scene
  DofNames names;
};

/// Returns the structure of a mesh or point scene. Collective. Throws Error for an element whose Jacobian is not
/// positive, with its part and place.
Structure assemble(const NumberedMesh& numbered, const Scene& scene, MPI_Comm comm);

/// Returns the load T' f of the scene's forces and pressures [N, N m]. Collective.
Owned<Vec> assemble_load(const Mesh& mesh, const Scene& scene, const DofMap& dofs, MPI_Comm comm);

/// Sets the preload by gravity and by the motions that supports prescribe, T' (M a - K u_s), and the sections of the
/// bolts, not yet tightened. Collective. Throws Error for a section that does not cut through.
void assemble_preload(Structure& structure, const NumberedMesh& numbered, const Scene& scene, MPI_Comm comm);

/// The tension of a bolt at u [N]. Collective.
double tension_of(const TightBolt& bolt, Vec u);

/// Returns the structure in the files M.petsc C.petsc K.petsc F.petsc of a folder, and of G.petsc and H.petsc where
/// they are there. C and F are zero without their files. Without a B.petsc C and K may be unsymmetric: their skew
/// parts join G and H. Collective. Throws Error for a file that is missing, truncated or not PETSc binary, and for
/// sizes that disagree. It does so for entries that are not finite or beyond 1e100, for an unsymmetric M, C or K, and
/// for a G or H that is not skew.
Structure read_structure(const std::filesystem::path& folder, MPI_Comm comm);

/// Counted work of a step: numbers of the stiffness. Collective.
double work_of_step(const Structure& structure);

/// Declares to PETSc that A stays symmetric and that its pattern is complete. Not collective.
void mark_symmetric(Mat A);

// Sparse rows on the free degrees of freedom, for matrices that read displacements of nodes: gaps, sliding velocities,
// probes.

using SparseRow = std::map<PetscInt, double>; // coefficient of each free degree of freedom

/// direction . (sum of weight u(node)), less what cancels up to rounding.
SparseRow displacement_row(const DofMap& dofs, std::span<const PairNode> nodes, const Vec3& direction);

/// Returns the AIJ matrix with this rank's rows. Collective.
Owned<Mat> matrix_of_rows(const std::vector<SparseRow>& rows, PetscInt local_columns, MPI_Comm comm);

/// Sets of this rank's rows or columns, and the part of A in them. Collective.
Owned<IS> set_of(MPI_Comm comm, const std::vector<PetscInt>& places);
Owned<IS> set_of(MPI_Comm comm, const IndexRange& range);
Owned<Mat> part_of(Mat A, IS rows, IS columns);

/// Ends the assembly of a matrix, or of a vector. Collective.
void finish(Mat A);
void finish(Vec x);

/// Returns this rank's range [first, last) of `count` items that are shared equally among the ranks in order. Not
/// collective.
std::pair<PetscInt, PetscInt> local_range(PetscInt count, MPI_Comm comm);

/// The node that each probe reads, by its place in the whole mesh: of its point, body or group, the nearest to its
/// position. Not collective.
/// Throws Error for one that is not there or is not the only one.
std::vector<int> probed_nodes(const std::vector<Probe>& probes, const Mesh& mesh);

/// Returns the matrix P with a row for each probe: the values of the probes are P q. Values are displacements [m].
/// Collective. Throws Error for a node that is not there, is not the only one or
/// cannot move.
Owned<Mat> probe_rows(const std::vector<Probe>& probes, const Mesh& mesh, const DofMap& dofs, MPI_Comm comm);

} // namespace squeal
