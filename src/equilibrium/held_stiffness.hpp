#pragma once
/// The stiffness of the equilibrium, factored, and the compliance of the pairs by it (src/README.md, section 2.3).
#include "squeal/contact/condensed.hpp"

#include <Eigen/Core>

namespace squeal
{

/// K, or K + kappa B_n' B_n where contact alone holds a body, factored.
struct Held
{
  Owned<Mat> augmented; // null when kappa = 0
  Factor factor;
  double kappa = 0; // [N/m]
};

/// Error: a body that neither supports nor contact hold (which one).
Held hold(const Structure& structure, const Interface& interface, const FactorOptions& options);

/// K + kappa B'B with springs across every row of the pairs: of structures that may hang on friction alone, which holds
/// bodies along their contacts, too. Error: a body that contact does not hold either (which one).
Held hold_by_all_rows(const Structure& structure, const Interface& interface, const FactorOptions& options);

/// The compliance of gaps to reactions, pairs x pairs: D_nn of normal ones, D_nt of friction along the axes. On rank 0.
struct GapCompliance
{
  Eigen::MatrixXd D_nn, D_nt;
};

/// From the condensed operator D of two rows a pair. Collective.
GapCompliance gap_compliance(const Factor& factor, int pairs, MPI_Comm comm);

} // namespace squeal
