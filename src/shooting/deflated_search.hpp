#pragma once
/// The largest Ritz values of (1 - V (W'V)^-1 W') dPhi_T/dx, in a block Arnoldi space (src/README.md, section 6.9).
#include "oblique_projector.hpp"

#include <optional>

namespace squeal
{

/// What the search beside V found.
struct DeflatedSearch
{
  bool bounded = false;             // its largest Ritz value is below 1 by more than its residual
  std::complex<double> largest = 0; // that value
  double residual = 0;              // of that value
  std::optional<StateBlock> vector; // of that value, real and imaginary part; where it is not bounded
  long columns = 0;                 // products with the monodromy matrix
};

/// Searches from the motions that are least in V, with at most `columns` columns, until the largest Ritz value is
/// bounded. Without motions V holds every motion that may decay slowly. Collective.
DeflatedSearch search_beside(const Monodromy& monodromy, const Projector& projector,
                             const std::vector<Owned<Vec>>& motions, Eigen::Index columns);

} // namespace squeal
