#pragma once
/// Element kernels (src/README.md, section 1.6): pure functions on arrays, without PETSc.
///
/// hex8, wedge6: incompatible modes in Taylor's corrected form. Both pass the patch test on any shape; hex8 does not
///     lock in bending, wedge6 does and is for filling.
/// Others: isoparametric, with full integration. Of these tet4 and pyramid5 lock in bending.
/// quad4, triangle3: flat shells with transverse shear (DKMQ, DKMT) and drilling rotations, six degrees of freedom a
///     node. Rigid links go from the nodes to the plane of a warped quadrilateral, and to a middle surface beside them.
/// quad8, quad9, triangle6: shells that consist of these.
/// Sources and caveats stand at each kernel. The mass follows from the same motion as the stiffness: it includes the
/// incompatible modes, and the curvature of shell sides between rotated ends.
#include "squeal/mesh/mesh.hpp"

#include <Eigen/Core>
#include <span>
#include <vector>

namespace squeal
{

/// Returns the number of degrees of freedom of each node: 3 (solid) or 6 (shell: x y z rx ry rz in global axes).
int dofs_per_node(Shape shape);

/// Symmetric matrices of order node_count * dofs_per_node, in the order node * dofs_per_node + component.
struct ElementMatrices
{
  Eigen::MatrixXd stiffness; // [N/m, N, N m]
  Eigen::MatrixXd mass;      // [kg, kg m, kg m2]
};

/// Returns the matrices of an element with nodes at x [m]. Shells alone use the thickness [m], and the arms [m] from
/// the nodes to the middle surface; without arms it is at the nodes. Throws std::runtime_error with the Jacobian if it
/// is not positive at an integration point.
ElementMatrices element_matrices(Shape shape, std::span<const Vec3> x, const Material& material, double thickness,
                                 std::span<const Vec3> arms = {});

/// Returns the stress xx yy zz xy yz zx [Pa] at the integration points of a solid under the nodal displacements u [m],
/// 3 a node.
std::vector<std::array<double, 6>> solid_stress(Shape shape, std::span<const Vec3> x, const Material& material,
                                                std::span<const double> u);

/// Matrices of a solid that spins, in the frame at rest (src/README.md, section 1.10), in the order of ElementMatrices.
struct SpinMatrices
{
  Eigen::MatrixXd gyroscopic;  // [N s/m] skew
  Eigen::MatrixXd centrifugal; // [N/m] symmetric, negative semidefinite
  Eigen::VectorXd force;       // [N] centrifugal
};

SpinMatrices spin_matrices(Shape shape, std::span<const Vec3> x, const Material& material, const Rotation& rotation);

/// Returns the stiffness [N/m] that the stress under the nodal displacements u [m] gives a solid.
Eigen::MatrixXd stress_stiffness(Shape shape, std::span<const Vec3> x, const Material& material,
                                 std::span<const double> u);

} // namespace squeal
