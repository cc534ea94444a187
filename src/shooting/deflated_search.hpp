#pragma once
/// The largest Ritz values of dPhi_T/dx beside known motions, in a block Arnoldi space (src/README.md, section 6.9).
#include "oblique_projector.hpp"

namespace squeal
{

/// The Ritz pair that was sought.
struct DeflatedSearch
{
  bool bounded = false;  // its value is below 1 by more than its residual
  DenseEigenpair pair{}; // its vector in the coordinates of Q; without entries: there is none
  double residual = 0;   // of that pair
  StateBlock Q{};        // energy-orthonormal
  long columns = 0;      // products with the monodromy matrix
};

/// The choice of the sought pair among Ritz pairs, and the end of the search.
struct SearchChoice
{
  std::function<std::size_t(const std::vector<DenseEigenpair>& pairs, const StateBlock& Q)> place;
  std::function<bool(const DeflatedSearch&)> ends; // asked after four blocks
};

/// Takes from each column what is known.
using Deflation = std::function<void(StateBlock&)>;

/// Searches from motions and random velocities, with at most `columns` columns beyond the first block. Collective.
DeflatedSearch search_beside(const Monodromy& monodromy, const Deflation& deflation,
                             const std::vector<Owned<Vec>>& motions, Eigen::Index columns, const SearchChoice& choice);

/// The largest multiplier, sought from motions that may grow. Bars: twice the residual of its Ritz pair and what other
/// grids of time change it by. Leaves the period recorded on its own grid. Collective.
FloquetAnalysis multipliers_by_search(const Monodromy& monodromy, const std::vector<Owned<Vec>>& motions,
                                      Eigen::Index columns);

} // namespace squeal
