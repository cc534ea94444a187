#pragma once
/// Element kernels: pure functions on arrays, no library.
///
/// hex8, wedge6: with incompatible modes in Taylor's corrected form (patch test on any shape; hex8 does not lock in
/// bending, wedge6 does and is for filling);
/// hex20, tet10: isoparametric, fully integrated; shell4, shell3: flat facets with transverse shear (DKMQ, DKMT) and
/// drilling rotations, six degrees of freedom a node, warped quadrilaterals on rigid offsets.
/// Sources and caveats stand at each kernel. Mass is consistent with the motion that the stiffness implies: it includes
/// the incompatible modes, and the bow of shell sides between rotated ends.
#include "squeal/mesh/mesh.hpp"

#include <span>
#include <vector>

namespace squeal
{

/// Degrees of freedom a node of this shape carries: 3 (solid) or 6 (shell: x y z rx ry rz, global axes).
int dofs_per_node(Shape shape);

/// Dense symmetric matrices, row-major, size = node_count * dofs_per_node; dof = node * dofs_per_node + component.
struct ElementMatrices
{
  std::vector<double> stiffness; // [N/m, N, N m]
  std::vector<double> mass;      // [kg, kg m, kg m2]
};

/// `x`: the element's node coordinates [m]; `thickness` [m] used by shells only.
/// Throws std::runtime_error naming the Jacobian if it is not positive at an integration point.
ElementMatrices element_matrices(Shape shape, std::span<const Vec3> x, const Material& material, double thickness);

/// Stress at the integration points, xx yy zz xy yz zx [Pa], of solids under nodal displacements u (3 per node).
std::vector<std::array<double, 6>> solid_stress(Shape shape, std::span<const Vec3> x, const Material& material,
                                                std::span<const double> u);

/// Shell resultants at the integration points, x along `axis1` projected on the element, z along its normal (its nodes
/// counter-clockwise): membrane forces Nx Ny Nxy = int stress dz [N/m], moments Mx My Mxy = int z stress dz [N], of
/// nodal displacements u (6 per node, global axes). Throws std::runtime_error if axis1 is normal to the element.
std::vector<std::array<double, 6>> shell_resultants(Shape shape, std::span<const Vec3> x, const Material& material,
                                                    double thickness, const Vec3& axis1, std::span<const double> u);

} // namespace squeal
