#pragma once
/// The stiffness of the equilibrium, factored (src/README.md, section 2.3).
#include "squeal/contact/condensed.hpp"

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

} // namespace squeal
