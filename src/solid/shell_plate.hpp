#pragma once
/// Bending and transverse shear strains of shells.
#include "shell_strains.hpp"

namespace squeal
{

/// Adds curvatures and transverse shear at xi, n = 3 or 4.
/// `slenderness` is 12 D_b / D_s = 2 h^2 / (kappa (1 - nu)) [m2], h the thickness and kappa the shear correction.
template <int n>
void add_plate(ShellStrains<n>& B, const PlanePositions<n>& X, const Eigen::Vector3d& xi, double slenderness);

} // namespace squeal
