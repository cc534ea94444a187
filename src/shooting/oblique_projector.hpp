#pragma once
/// The oblique projector V (W'V)^-1 W' on approximate right vectors V (src/README.md, section 6.9). W holds energy
/// images of approximate left vectors. All functions are collective.
#include "monodromy.hpp"
#include "state_block.hpp"

#include <Eigen/QR>

namespace squeal
{

/// Parts of a direction below this are dropped: rounding of the energy product's squares.
inline constexpr double least_part = 1e-10;

/// V (W'V)^-1 W'
struct Projector
{
  StateBlock V, W; // W holds energy images of left vectors
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> gram{};
};

/// Makes the projector fit V, which is orthonormal. Returns the condition of W'V.
double fit(Projector& projector);

/// (W'V)^-1 W'X
Eigen::MatrixXd coefficients(const Projector& projector, const StateBlock& X);

/// X without its part in the span of V.
void deflate(const Projector& projector, StateBlock& X);

/// dPhi_T/dx X
StateBlock image_of(const Monodromy& monodromy, const StateBlock& X);

} // namespace squeal
