#pragma once
/// Strains of a flat shell element in its own plane, local axes x y z.
#include "squeal/mesh/shape_functions.hpp"

namespace squeal
{

/// Local degrees of freedom of a node: u v w rx ry rz, six columns each.
/// Rows: membrane exx eyy gxy; drilling; curvature kxx kyy kxy; transverse shear gxz gyz.
using ShellStrains = BoundedMatrix<9, 24>;
using PlanePositions = BoundedMatrix<2, 4>; // one node a column [m]
using PlaneGradients = BoundedMatrix<2, 8>; // d/dx, d/dy of shape functions, one node a column

/// Membrane of shell4 and its drilling strain  (dv/dx - du/dy)/2 - rz.
void add_quad_membrane(ShellStrains& B, const NodeValues& N, const PlaneGradients& g);

/// Strains of the incompatible modes 1 - xi^2, 1 - eta^2 (u, v of each: four columns).
ShellStrains quad_membrane_modes(const Eigen::Vector3d& xi, const Eigen::Matrix2d& mean_inverse);

/// Membrane of shell3 at the middle of side `side` (0: between nodes 0 and 1, ...).
void add_triangle_membrane(ShellStrains& B, const PlanePositions& X, double poisson, std::size_t side);

/// Curvature and transverse shear of either shape at `xi`. `slenderness` = 12 D_b / D_s = 2 h^2 / (kappa (1 - nu))
/// [m2].
void add_plate(ShellStrains& B, const PlanePositions& X, const Eigen::Vector3d& xi, double slenderness);

} // namespace squeal
