#pragma once
/// Strain operators of flat shell elements with n nodes, in the element's own axes x, y in its plane and z normal.
#include "squeal/mesh/shape_functions.hpp"

namespace squeal
{

/// Strains of unit nodal displacements. Columns: u v w rx ry rz of each node.
/// Rows: membrane exx eyy gxy; drilling strain; curvatures kxx kyy kxy; transverse shear gxz gyz.
template <int n> using ShellStrains = Eigen::Matrix<double, 9, 6 * n>;
template <int n> using PlanePositions = Eigen::Matrix<double, 2, n>; // [m] one node a column

/// Adds the membrane and drilling strains of shell4; `gradients` holds dN/dx, dN/dy [1/m] in its rows.
void add_quad_membrane(ShellStrains<4>& B, const NodeValues& N, const Eigen::Matrix<double, 2, 4>& gradients);

/// Strains of unit amplitudes of the incompatible modes 1 - xi^2 and 1 - eta^2, each in u and v.
using ShellModeStrains = Eigen::Matrix<double, 9, 4>;

/// Returns the strains of the incompatible modes. `mean_inverse` is det(J0)/det(J) J0^-1 [1/m], J0 at the centre.
ShellModeStrains quad_membrane_modes(const Eigen::Vector3d& xi, const Eigen::Matrix2d& mean_inverse);

/// Adds the membrane strains of shell3 at the middle of a side: side 0 between nodes 0 and 1, and so on.
void add_triangle_membrane(ShellStrains<3>& B, const PlanePositions<3>& X, double poisson, int side);

/// Adds curvatures and transverse shear at xi, n = 3 or 4.
/// `slenderness` is 12 D_b / D_s = 2 h^2 / (kappa (1 - nu)) [m2], h the thickness and kappa the shear correction.
template <int n>
void add_plate(ShellStrains<n>& B, const PlanePositions<n>& X, const Eigen::Vector3d& xi, double slenderness);

} // namespace squeal
