#pragma once
/// Strain operators of flat shell elements with n nodes, in the element's own axes x, y in its plane and z normal.
#include "squeal/mesh/shape_functions.hpp"

namespace squeal
{

/// Strains of unit nodal displacements. Columns: u v w rx ry rz of each node.
/// Rows: membrane exx eyy gxy; drilling strain; curvatures kxx kyy kxy; transverse shear gxz gyz.
template <int n> using ShellStrains = Eigen::Matrix<double, 9, 6 * n>;
template <int n> using PlanePositions = Eigen::Matrix<double, 2, n>; // [m] one node a column

} // namespace squeal
