#pragma once
/// Contributions to the matrices of a structure, which is their sum. Each adds T_e' A T_e and T_e' f, u_e = T_e q, to
/// matrices and vectors of the free degrees of freedom. Sections of bolts; parts that spin in the frame at rest
/// (src/README.md, section 1.10).
#include "squeal/solid/structure.hpp"

#include <Eigen/Core>
#include <functional>

namespace squeal
{

/// Matrices on the nodal degrees of freedom of a few nodes.
struct Contribution
{
  std::vector<PetscInt> nodal_dofs;
  Eigen::MatrixXd M, C, K; // units as in Structure
  double loss_factor = 0;  // [-]
};

/// Angular frequency at which loss factors have their viscous equivalent [rad/s]; 0: there are none.
double loss_omega(const Scene& scene);

/// Returns the contribution of an element. Throws std::runtime_error with its part and place if its Jacobian is not
/// positive.
Contribution element_contribution(const NumberedMesh& numbered, const Scene& scene, std::size_t index);

/// Contributions of points, bodies, couplings, added masses, springs, connectors, superelements and beams. The mesh
/// must be whole.
std::vector<Contribution> lumped_contributions(const Mesh& mesh, const Scene& scene);

/// The elements that add to rows of this rank, ascending.
std::vector<std::size_t> elements_here(const NumberedMesh& numbered);

/// Which rows of matrices and vectors a rank adds to.
enum class AddedRows
{
  own, // of what every rank adds that it concerns: no sum then depends on the order of messages
  all,
};

/// Calls visit for every contribution that this rank adds: of elements to its own rows; of what is lumped on rank 0 to
/// all rows. Collective: what one throws all throw.
void for_each_contribution(const NumberedMesh& numbered, const Scene& scene, MPI_Comm comm,
                           const std::function<void(const Contribution&, AddedRows)>& visit);

/// Contributions of the elements of a beam, from end to end.
std::vector<Contribution> beam_contributions(const Mesh& mesh, const Scene& scene, std::size_t index);

/// The first `components` degrees of freedom of each node.
std::vector<PetscInt> nodal_dofs_of(std::span<const int> nodes, int components);

std::vector<PetscInt> nodal_dofs_of(const Element& element);

/// An entry of T_e.
struct LocalTerm
{
  Eigen::Index nodal = 0; // position in the nodal degrees of freedom
  Eigen::Index free = 0;  // position in the free ones
  double factor = 0;
};

/// T_e of some nodal degrees of freedom.
struct LocalDofs
{
  std::vector<PetscInt> free; // ascending
  std::vector<PetscInt> rows; // the same, -1 for those that are not added to
  std::vector<LocalTerm> terms;
};

LocalDofs local_dofs(const DofMap& dofs, const std::vector<PetscInt>& nodal_dofs, AddedRows added);

/// Adds T_e' A T_e; A of any symmetry.
void add_matrix(Mat matrix, const LocalDofs& local, const Eigen::MatrixXd& A);

/// Adds T_e' f.
void add_vector(Vec vector, const LocalDofs& local, const Eigen::VectorXd& f);

/// A contribution that a section cuts, and the motion of its nodal degrees of freedom that a unit of shortening adds to
/// what it sees.
struct Cut
{
  Contribution of;
  Eigen::VectorXd shift;
};

/// The part of a bolt that its section cuts. A section of nodes cuts the elements on the side that the axis points to:
/// they see its nodes moved against the axis. The mesh must be whole. Throws Error for a section that does not cut
/// through a shank, and for nodes in a contact or tie.
std::vector<Cut> cuts_of(const Bolt& bolt, const NumberedMesh& numbered, const Scene& scene);

/// Adds G, and to K the centrifugal part with the stiffness of the centrifugal stress. M, C and K are assembled.
/// Collective. Throws Error for a part that spins and is no solid of revolution
/// about its axis.
void add_spin(Structure& structure, const NumberedMesh& numbered, const Scene& scene);

} // namespace squeal
