#include "held_stiffness.hpp"

#include "squeal/base/disjoint_sets.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <Eigen/Eigenvalues>
#include <map>
#include <numeric>

namespace squeal
{

namespace
{

std::size_t at(PetscInt i)
{
  return static_cast<std::size_t>(i);
}

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

/// Of each degree of freedom the least one of its body, that is of those that K connects it to. Collective.
std::vector<int> bodies_of(Mat K)
{
  DisjointSets sets(static_cast<std::size_t>(row_layout(K).total()));
  for_each_row(K,
               [&](PetscInt row, std::span<const PetscInt> columns, std::span<const double>)
               {
                 for (const PetscInt column : columns) // K is symmetric
                   if (column < row) sets.join(to_int(row), to_int(column));
               });
  std::vector<int> body(static_cast<std::size_t>(sets.size()));
  for (int changed = 1; changed != 0;) // until what this rank joined agrees with the others
  {
    for (int i = 0; i < sets.size(); ++i) body[at(i)] = sets.least(i);
    const std::vector<int> own = body;
    MPI_Allreduce(own.data(), body.data(), sets.size(), MPI_INT, MPI_MIN, comm_of(K));
    for (int i = 0; i < sets.size(); ++i) sets.join(i, body[at(i)]);
    changed = body != own;
    MPI_Allreduce(MPI_IN_PLACE, &changed, 1, MPI_INT, MPI_MAX, comm_of(K));
  }
  return body;
}

/// The least x'K x/x' diag(K) x of translations x of a body as a whole: a bound of the least of all motions, which
/// tells without a factor that only contact holds a brake's pad. 1 on a matrix scene. Collective.
double resistance_to_translations(const Structure& structure)
{
  const std::vector<PetscInt>& nodal_dof = structure.names.nodal_dof;
  if (nodal_dof.empty()) return 1;
  const std::vector<int> body = bodies_of(structure.K);
  std::map<int, std::size_t> place;
  for (const int least : body) place.emplace(least, place.size());
  std::vector<Eigen::Matrix3d> K(place.size(), Eigen::Matrix3d::Zero()), D = K;
  const auto direction = [&](PetscInt dof) { return nodal_dof[at(dof)] % 6; }; // three and more are rotations
  for_each_row(structure.K,
               [&](PetscInt row, std::span<const PetscInt> columns, std::span<const double> values)
               {
                 const PetscInt i = direction(row);
                 const std::size_t k = place[body[at(row)]];
                 for (std::size_t c = 0; i < 3 && c < columns.size(); ++c)
                 {
                   if (const PetscInt j = direction(columns[c]); j < 3) K[k](i, j) += values[c];
                   if (columns[c] == row) D[k](i, i) += values[c];
                 }
               });
  const auto add_ranks = [&](std::vector<Eigen::Matrix3d>& sums)
  {
    MPI_Allreduce(MPI_IN_PLACE, sums.front().data(), to_int(9 * sums.size()), MPI_DOUBLE, MPI_SUM,
                  comm_of(structure.K));
  };
  add_ranks(K);
  add_ranks(D);
  double least = 1;
  for (std::size_t k = 0; k < K.size(); ++k)
  {
    for (Eigen::Index i = 0; i < 3; ++i)
      if (D[k](i, i) == 0) K[k](i, i) = D[k](i, i) = 1; // the body does not move that way
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix3d> pencil(K[k], D[k], Eigen::EigenvaluesOnly);
    least = std::min(least, pencil.eigenvalues().minCoeff());
  }
  return least;
}

} // namespace

Held hold(const Structure& structure, const Interface& interface, const FactorOptions& options)
{
  // Springs this soft beside the rest lose the digits of the reactions, which contact would hold.
  constexpr double soft = 1e-10;
  Factored own; // of K
  own.resistance = interface.pairs > 0 ? resistance_to_translations(structure) : 1;
  const bool by_contact = own.resistance < soft;
  if (!by_contact) own = factor_positive(structure.K, interface, options);
  Held held;
  if (by_contact || (interface.pairs > 0 && (own.loose || own.resistance < soft)))
  {
    own.factor = Factor(); // two of them side by side would be the most that a run ever holds
    held.kappa = typical_stiffness(structure.K);
    held.augmented = normal_springs(interface); // K added to these saves a copy of K
    check(MatScale(held.augmented, held.kappa));
    check(MatAXPY(held.augmented, 1, structure.K, DIFFERENT_NONZERO_PATTERN));
    check(MatSetOption(held.augmented, MAT_SYMMETRIC, PETSC_TRUE));
    Factored with_contact = factor_positive(held.augmented, interface, options);
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
  if (own.loose)
    throw Error("equilibrium: the stiffness is singular: neither supports, springs nor contact hold " +
                describe(structure.names, *own.loose) + "; give it a support or a spring");
  held.factor = std::move(own.factor);
  return held;
}

Held hold_by_all_rows(const Structure& structure, const Interface& interface, const FactorOptions& options)
{
  constexpr double part = 1e-2; // of the structure's stiffness: long chains of bodies lose digits by more
  Held held;
  held.kappa = part * typical_stiffness(structure.K);
  check(MatTransposeMatMult(interface.B, interface.B, MAT_INITIAL_MATRIX, PETSC_DEFAULT, held.augmented.put()));
  check(MatScale(held.augmented, held.kappa));
  check(MatAXPY(held.augmented, 1, structure.K, DIFFERENT_NONZERO_PATTERN));
  check(MatSetOption(held.augmented, MAT_SYMMETRIC, PETSC_TRUE));
  Factored factored = factor_positive(held.augmented, interface, options);
  if (factored.loose)
    throw Error("equilibrium: the stiffness is singular: neither supports, springs nor contact hold " +
                describe(structure.names, *factored.loose) + "; give it a support or a spring");
  held.factor = std::move(factored.factor);
  return held;
}

GapCompliance gap_compliance(const Factor& factor, int pairs, MPI_Comm comm)
{
  GapCompliance D;
  if (pairs == 0) return D;
  if (rank_of(comm) == 0) D = {Eigen::MatrixXd(pairs, pairs), Eigen::MatrixXd(pairs, pairs)};
  const PairRows<std::size_t> rows(1);
  const auto copy = [&](const CondensedStrip& strip, std::size_t i, std::size_t j)
  {
    const auto row = static_cast<Eigen::Index>(i), column = static_cast<Eigen::Index>(j);
    D.D_nn(row, column) = D.D_nn(column, row) = strip.entry(rows.normal(i), rows.normal(j));
    D.D_nt(column, row) = strip.entry(rows.tangential(i), rows.normal(j));
    if (i > j) D.D_nt(row, column) = strip.entry(rows.normal(i), rows.tangential(j));
  };
  factor.read_condensed(
      [&](const CondensedStrip& strip)
      {
        constexpr std::size_t together = 32; // rows, whose transposes stay in the cache
        const std::size_t first = rows.pair_of(strip.first), last = rows.pair_of(strip.last),
                          end = rows.pair_of(strip.first + strip.height);
        for (std::size_t begin = first; begin < end; begin += together)
          for (std::size_t j = first; j < last; ++j)
            for (std::size_t i = std::max(j, begin); i < std::min(begin + together, end); ++i) copy(strip, i, j);
      });
  return D;
}

} // namespace squeal
