#pragma once
/// Membrane and drilling strains of shells.
#include "shell_strains.hpp"

namespace squeal
{

/// Adds the membrane and drilling strains of shell4; `gradients` holds dN/dx, dN/dy [1/m] in its rows.
void add_quad_membrane(ShellStrains<4>& B, const NodeValues& N, const Eigen::Matrix<double, 2, 4>& gradients);

/// Strains of unit amplitudes of the incompatible modes 1 - xi^2 and 1 - eta^2, each in u and v.
using ShellModeStrains = Eigen::Matrix<double, 9, 4>;

/// Returns the strains of the incompatible modes. `mean_inverse` is det(J0)/det(J) J0^-1 [1/m], J0 at the centre.
ShellModeStrains quad_membrane_modes(const Eigen::Vector3d& xi, const Eigen::Matrix2d& mean_inverse);

/// Adds the membrane strains of shell3 at the middle of a side: side 0 between nodes 0 and 1, and so on.
void add_triangle_membrane(ShellStrains<3>& B, const PlanePositions<3>& X, double poisson, int side);

} // namespace squeal
