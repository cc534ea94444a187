#pragma once
/// The search for an equilibrium on the rows of the pairs (src/README.md, sections 2.2 to 2.9). Of structures whose
/// pairs are all driven the unknowns are normal rows alone: friction is part of the compliance,
///     M = D_nn + mu D_nt e,
/// and one increment is exact. Others are walked along their load path.
#include "held_stiffness.hpp"
#include "squeal/equilibrium/equilibrium.hpp"
#include "squeal/equilibrium/path_walk.hpp"

#include <optional>

namespace squeal
{

/// Operators that models of one K and one B share: neither loads, friction nor the drive change it.
struct PathOperators
{
  Owned<Mat> K, B;
  bool driven = false; // all pairs
  Held held;
  Eigen::MatrixXd D; // compliance of the rows of the problem to forces on all rows of the pairs; on rank 0
};

/// Error: as of hold and hold_by_all_rows. Collective.
PathOperators path_operators(const Structure& structure, const Interface& interface, const EquilibriumOptions& options);

/// Where a search starts.
struct PathStart
{
  std::vector<char> closed{};            // of driven pairs, expected; of another size: all of them
  std::optional<StickSlipState> state{}; // from which undriven pairs take one increment: reactions, minus the offsets
};

/// The equilibrium under the structure's load, along its path where pairs are undriven. Collective.
Equilibrium find_by_path(const PathOperators& operators, const Structure& structure, const Interface& interface,
                         const PathStart& start);

} // namespace squeal
