#pragma once
/// Sliding equilibrium in unilateral contact with Coulomb friction (src/README.md, section 2):
///     K u0 = F + B_n' r_n + B_t' r_t,   0 <= g _|_ r_n >= 0,   r_t = mu r_n e,   e = v_d/|v_d|.
/// Newton's method on the statuses of the pairs by the condensed compliance D = B K^-1 B'; the natural map checks it.
///
/// Where contact alone holds a body, K is singular. Springs across every pair are then added, and their force is taken
/// off again (section 2.3). So it is where springs are so soft that rounding would spoil the reactions.
///
/// Caveat: at large mu an equilibrium may not exist, or not be the only one. It is the only one if the symmetric part
/// of D_nn + mu D_nt e is positive definite. That is checked where K alone is regular. Its stability is found by the
/// modes.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/contact/interface.hpp"
#include "squeal/equilibrium/state.hpp"

#include <memory>
#include <optional>

namespace squeal
{

/// Whether the equilibrium is the only one (src/README.md, section 2.7).
enum class Uniqueness
{
  not_checked, // contact alone holds a body
  assured,
  not_assured,
};

template <> inline constexpr std::array words_of<Uniqueness> = {"not checked", "assured", "not assured"};

/// How a structure with undriven pairs came to its equilibrium, and what is known of it (src/README.md, section 2.9).
struct LoadHistory
{
  int increments = 0;                    // of the path in all
  double change = 0;                     // [-] of reactions over the largest of their contact, from half as many
  int stick = 0, slip = 0, open = 0;     // undriven pairs, by the last increment
  int at_limit = 0;                      // those that stick within 1 % of their friction
  int index = 0;                         // sign of the determinant of the status system: -1 no rate follows
  double reciprocal_condition = 0;       // of that system, by its pivots
  std::vector<ContactStatus> statuses{}; // of all pairs
};

/// outcome: "converged", "no equilibrium" (no set of closed pairs balances the load, which is proved: mu is too large),
/// "not converged". u and the reactions are zero without an equilibrium.
/// residual: the largest natural map of a pair, |r_n - max(0, r_n - g/D_nn)|, over the largest reaction.
struct Equilibrium
{
  Outcome outcome;
  Owned<Vec> u;                   // [m]
  std::vector<double> reactions;  // [N] a contact vector
  int directions = 2;             // tangential entries of a pair in it
  std::vector<char> closed;       // per pair
  std::vector<double> gaps;       // [m] per pair, g + c r_n: zero where closed
  double force_residual = 0;      // |K u - F - B'r| / |F|
  double auxiliary_stiffness = 0; // kappa [N/m]; 0: K holds the structure by itself
  Uniqueness uniqueness = Uniqueness::not_checked;
  std::optional<LoadHistory> history{}; // where there are undriven pairs
};

/// A model at its sliding equilibrium, as every stage after it sees it. Borrows all three.
struct SlidingEquilibrium
{
  const Structure& structure;
  const Interface& interface;
  const Equilibrium& equilibrium;
};

/// How an equilibrium is sought.
struct EquilibriumOptions
{
  FactorOptions factor{};
};

struct PathOperators;

/// Equilibria of models of one layout, one after the other. The stiffness factored and the compliance D of the pairs
/// are kept while the models share K and B. Neither load, friction nor drive changes them.
class Equilibria
{
public:
  explicit Equilibria(const EquilibriumOptions& options);
  Equilibria(const Equilibria&) = delete;
  Equilibria& operator=(const Equilibria&) = delete;
  ~Equilibria();

  /// Finds the equilibrium, first with the closed pairs that are expected: those of the one before. Collective. Error:
  /// K is singular on a body that contact does not hold either (which body).
  Equilibrium at(const Structure& structure, const Interface& interface);

  /// The rest of a structure with undriven pairs that are stuck elsewhere than at the end of its path. `offsets`: B u
  /// there [m], a contact vector of which their tangential rows count. Collective.
  Equilibrium at_offsets(const SlidingEquilibrium& path, const std::vector<double>& offsets);

  void expect(const std::vector<char>& closed) { expected_ = closed; }
  int factors() const { return factors_; } // made so far

private:
  const PathOperators& operators_for(const Structure& structure, const Interface& interface);

  EquilibriumOptions options_;
  std::unique_ptr<PathOperators> kept_;
  std::vector<char> expected_{}; // empty: none are
  int factors_ = 0;
};

/// A single equilibrium. Collective. Error: as of Equilibria.
Equilibrium find_equilibrium(const Structure& structure, const Interface& interface, const EquilibriumOptions& options);

// Tightening of bolts along the load path.

/// Finds the shortenings that give bolts their tension in the equilibrium at the ends of the steps that tighten them.
/// Adds what they do to the loads of these steps and all later ones. Newton's method, with the slopes by differences.
/// Collective. Throws Error where there is no such equilibrium.
void tighten(Structure& structure, const Interface& interface);

} // namespace squeal
