#pragma once
/// The stiffness of the equilibrium, factored (src/README.md, section 2.3).
#include "squeal/contact/contact_operator.hpp"
#include "squeal/contact/stick_slip.hpp"
#include "squeal/equilibrium/equilibrium.hpp"
#include "squeal/equilibrium/path_walk.hpp"

#include <Eigen/Core>
#include <optional>

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

// The search for an equilibrium on the rows of the pairs (src/README.md, sections 2.2 to 2.9). Where all pairs are
// driven the unknowns are normal rows alone, and one increment is exact. Friction is part of the compliance then,
//     M = D_nn + mu D_nt e.
// Other structures are walked along their load path.

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

// Whether an equilibrium balances the load (src/README.md, section 2.6).

/// Sets the force residual. Returns whether it is small, or at the rounding of K u: a soft support lets u be large
/// beside the strains. Collective.
bool balances(const Structure& structure, const Interface& interface, Equilibrium& equilibrium);

// The rest of driven pairs where Newton's method on the statuses ends without one: 0 <= w _|_ r >= 0, N w = q + M r.

/// The end of Lemke's path, on which z falls and one pair at a time is neither open nor closed (Cottle, Pang and Stone
/// 1992, section 4.4). Nothing where it leads away.
std::optional<StickSlipState> rest_by_path(const StickSlipOperator& of, const Eigen::VectorXd& q);

/// A solution by trying every set of closed pairs, of few pairs alone: none means that there is none.
std::optional<StickSlipState> rest_of_few(const StickSlipOperator& of, const Eigen::VectorXd& q);

} // namespace squeal
