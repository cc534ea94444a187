#pragma once
/// The equilibrium of a structure with undriven pairs, at the end of its load path (src/README.md, section 2.9).
#include "held_stiffness.hpp"
#include "squeal/equilibrium/equilibrium.hpp"
#include "squeal/equilibrium/path_walk.hpp"

#include <optional>

namespace squeal
{

/// Operators that models of one K and one B share: neither loads nor friction change it.
struct PathOperators
{
  Owned<Mat> K, B;
  Held held;
  Eigen::MatrixXd D; // compliance of all rows of the pairs, by K with springs; on rank 0
};

/// Error: as of hold_by_all_rows. Collective.
PathOperators path_operators(const Structure& structure, const Interface& interface, const EquilibriumOptions& options);

/// Walks along the structure's path to its load; where a state is given, by one increment from there, reactions and
/// minus the offsets of undriven pairs. Collective.
Equilibrium find_by_path(const PathOperators& operators, const Structure& structure, const Interface& interface,
                         const std::optional<StickSlipState>& from);

} // namespace squeal
