#pragma once
/// The stiffness of the equilibrium, factored (src/README.md, section 2.3).
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

} // namespace squeal
