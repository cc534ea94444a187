#pragma once
/// States of a small system as coordinates that every rank holds, and its whole monodromy matrix in them.
#include "squeal/shooting/orbit.hpp"

#include <Eigen/Dense>

namespace squeal
{

/// Entries of a state, velocities over 2 pi/T: of the displacements' size in a vibration.
Eigen::VectorXd coordinates_of(Vec state, double period);

/// The state of these coordinates, laid out as the orbit's.
Owned<Vec> state_at(const Eigen::VectorXd& coordinates, const Orbit& orbit);

/// Orthonormal columns: of these coordinates all but velocities without mass, on which no motion depends. A theta step
/// carries those along as (v_theta - (1 - theta) v)/theta, so that they have multipliers of their own, [-(1 -
/// theta)/theta]^N a period of N steps: 1 in modulus at theta = 1/2. Motions along offsets that are held in the period
/// recorded last are left out, too: each has a multiplier 1. Collective.
Eigen::MatrixXd coordinates_with_mass(const Flow& flow);

/// The matrix in these coordinates of a linear map that `multiply` applies to many states in place.
Eigen::MatrixXd whole_matrix(const Orbit& orbit, const std::function<void(std::span<const Owned<Vec>>)>& multiply);

} // namespace squeal
