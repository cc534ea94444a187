#pragma once
/// The largest Ritz values of dPhi_T/dx beside known motions, in a block Arnoldi space (src/README.md, section 6.9).
#include "oblique_projector.hpp"

namespace squeal
{

/// The largest Ritz pair.
struct DeflatedSearch
{
  bool bounded = false;  // its value is below 1 by more than its residual
  DenseEigenpair pair{}; // its vector in the coordinates of Q; without entries: there is none
  double residual = 0;   // of that pair
  StateBlock Q{};        // energy-orthonormal
  long columns = 0;      // products with the monodromy matrix
};

/// Takes from each column what is known.
using Deflation = std::function<void(StateBlock&)>;

/// Searches from random velocities, with at most `columns` columns beyond the first block, until the largest value is
/// bounded or known well enough for a projection to go on from. Collective.
DeflatedSearch search_beside(const Monodromy& monodromy, const Deflation& deflation, Eigen::Index columns);

} // namespace squeal
