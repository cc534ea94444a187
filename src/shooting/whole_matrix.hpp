#pragma once
/// All motions of a small system side by side, for its whole monodromy matrix.
#include "state_block.hpp"

namespace squeal
{

/// Orthonormal columns in coordinates of displacements and of velocities over 2 pi/T, which are of their size in a
/// vibration.
struct WholeSpace
{
  StateBlock right; // the states of the columns
  StateBlock left;  // a state x has the coordinates left'x
};

/// All motions but velocities without mass, on which none depends. A theta step carries those along as (v_theta - (1 -
/// theta) v)/theta, so that they have multipliers of their own, [-(1 - theta)/theta]^N a period of N steps: 1 in
/// modulus at theta = 1/2. Motions along offsets that are held in the period recorded last are left out, too: each has
/// a multiplier 1. Collective.
WholeSpace whole_space(const Flow& flow, double period);

} // namespace squeal
