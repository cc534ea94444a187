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

/// The matrix in these coordinates of a linear map that `multiply` applies to many states in place.
Eigen::MatrixXd whole_matrix(const Orbit& orbit, const std::function<void(std::span<const Owned<Vec>>)>& multiply);

} // namespace squeal
