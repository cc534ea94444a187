#include "held_stiffness.hpp"

#include <numeric>

namespace squeal
{

namespace
{

/// B_n' B_n
Owned<Mat> normal_springs(const Interface& interface)
{
  std::vector<int> all(static_cast<std::size_t>(interface.pairs));
  std::iota(all.begin(), all.end(), 0);
  const Owned<Mat> B_n = rows_of(interface, all, RowsTaken::normal);
  Owned<Mat> product;
  check(MatTransposeMatMult(B_n, B_n, MAT_INITIAL_MATRIX, PETSC_DEFAULT, product.put()));
  return product;
}

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

} // namespace

Held hold(const Structure& structure, const Interface& interface, const FactorOptions& options)
{
  // Springs this soft beside the rest lose the digits of the reactions, which contact would hold.
  constexpr double soft = 1e-10;
  Factored first = factor_positive(structure.K, interface, options);
  Held held;
  if (interface.pairs > 0 && (first.loose || first.resistance < soft))
  {
    first.factor = Factor(); // two of them side by side would be the most that a run ever holds
    held.kappa = typical_stiffness(structure.K);
    held.augmented = copy_of(structure.K);
    check(MatAXPY(held.augmented, held.kappa, normal_springs(interface), DIFFERENT_NONZERO_PATTERN));
    check(MatSetOption(held.augmented, MAT_SYMMETRIC, PETSC_TRUE));
    Factored second = factor_positive(held.augmented, interface, options);
    if (!second.loose && (first.loose || second.resistance > 10 * first.resistance))
    {
      held.factor = std::move(second.factor);
      return held;
    }
    held = {};
    if (first.loose)
    {
      first.loose = second.loose;
      first.indefinite = second.indefinite;
    }
    else
    {
      second.factor = Factor();
      first = factor_positive(structure.K, interface, options);
    }
  }
  if (first.loose && first.indefinite)
    throw Error("equilibrium: the stiffness is not positive definite: a motion that is largest at " +
                describe(structure.names, *first.loose) +
                " is driven on, not back, and the structure diverges (buckles) from any rest; look for a stiffness of "
                "the wrong sign, or a load beyond the critical one");
  if (first.loose)
    throw Error("equilibrium: the stiffness is singular: neither supports, springs nor contact hold " +
                describe(structure.names, *first.loose) + "; give it a support or a spring");
  held.factor = std::move(first.factor);
  return held;
}

} // namespace squeal
