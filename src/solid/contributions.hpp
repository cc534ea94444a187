#pragma once
/// Contributions, of which the matrices of a structure are the sum.
#include "squeal/solid/dofs.hpp"

#include <Eigen/Core>

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

/// Contributions of the elements of a beam, from end to end.
std::vector<Contribution> beam_contributions(const Mesh& mesh, const Scene& scene, std::size_t index);

} // namespace squeal
