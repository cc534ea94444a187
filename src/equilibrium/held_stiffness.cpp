#include "held_stiffness.hpp"

#include "squeal/base/error.hpp"

#include <numeric>

namespace squeal
{

namespace
{

/// Any kappa is exact; one of the size of the structure's own stiffness keeps the digits.
double typical_stiffness(Mat K)
{
  Owned<Vec> diagonal;
  check(MatCreateVecs(K, diagonal.put(), nullptr));
  check(MatGetDiagonal(K, diagonal));
  double largest = 0;
  check(VecNorm(diagonal, NORM_INFINITY, &largest));
  return largest > 0 ? largest : 1;
}

/// K with springs kappa across these rows, and its factor.
Factored add_springs(const Structure& structure, const Interface& interface, Mat rows, const FactorOptions& options,
                     Held& held)
{
  check(MatTransposeMatMult(rows, rows, MAT_INITIAL_MATRIX, PETSC_DEFAULT, held.augmented.put()));
  check(MatScale(held.augmented, held.kappa)); // K added to these saves a copy of K
  check(MatAXPY(held.augmented, 1, structure.K, DIFFERENT_NONZERO_PATTERN));
  check(MatSetOption(held.augmented, MAT_SYMMETRIC, PETSC_TRUE));
  return factor_positive(held.augmented, interface, options);
}

[[noreturn]] void throw_loose(const Structure& structure, PetscInt loose)
{
  throw Error("equilibrium: the stiffness is singular: neither supports, springs nor contact hold " +
              describe(structure.names, loose) + "; give it a support or a spring");
}

} // namespace

Held hold(const Structure& structure, const Interface& interface, const FactorOptions& options)
{
  // Springs this soft beside the rest lose the digits of the reactions, which contact would hold.
  constexpr double soft = 1e-10;
  Factored own = factor_positive(structure.K, interface, options);
  Held held;
  if (interface.pairs > 0 && (own.loose || own.resistance < soft))
  {
    own.factor = Factor(); // two of them side by side would be the most that a run ever holds
    held.kappa = typical_stiffness(structure.K);
    std::vector<int> all(static_cast<std::size_t>(interface.pairs));
    std::iota(all.begin(), all.end(), 0);
    Factored with_contact =
        add_springs(structure, interface, rows_of(interface, all, RowsTaken::normal), options, held);
    if (!with_contact.loose && (own.loose || with_contact.resistance > 10 * own.resistance))
    {
      held.factor = std::move(with_contact.factor);
      return held;
    }
    held = {};
    with_contact.factor = Factor();
    if (!own.loose) own = factor_positive(structure.K, interface, options);
    if (own.loose && with_contact.loose)
    {
      own.loose = with_contact.loose;
      own.indefinite = with_contact.indefinite;
    }
  }
  if (own.loose && own.indefinite)
    throw Error("equilibrium: the stiffness is not positive definite: a motion that is largest at " +
                describe(structure.names, *own.loose) +
                " is driven on, not back, and the structure diverges (buckles) from any rest; look for a stiffness of "
                "the wrong sign, or a load beyond the critical one");
  if (own.loose) throw_loose(structure, *own.loose);
  held.factor = std::move(own.factor);
  return held;
}

Held hold_by_all_rows(const Structure& structure, const Interface& interface, const FactorOptions& options)
{
  constexpr double part = 1e-2; // of the structure's stiffness: long chains of bodies lose digits by more
  Held held;
  held.kappa = part * typical_stiffness(structure.K);
  Factored factored = add_springs(structure, interface, interface.B, options, held);
  if (factored.loose) throw_loose(structure, *factored.loose);
  held.factor = std::move(factored.factor);
  return held;
}

} // namespace squeal
