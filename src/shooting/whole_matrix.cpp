#include "whole_matrix.hpp"

#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/base/constants.hpp"

namespace squeal
{

namespace
{

/// Displacements with one entry 1 each.
MultiVector unit_displacements(const Flow& flow)
{
  PetscInt first = 0, last = 0, n = 0;
  check(MatGetSize(flow.M, &n, nullptr));
  check(MatGetOwnershipRangeColumn(flow.M, &first, &last));
  MultiVector X{comm_of(flow.M), Eigen::MatrixXd::Zero(last - first, n)};
  X.entries.middleCols(first, last - first).diagonal().setOnes();
  return X;
}

/// Orthonormal columns that span the displacements without the offsets held in the period recorded last.
MultiVector displacements_without_held(const Flow& flow)
{
  const MultiVector units = unit_displacements(flow);
  if (!flow.offsets.without_held) return units;
  MultiVector without = units;
  Owned<Vec> x;
  check(MatCreateVecs(flow.M, x.put(), nullptr));
  for (Eigen::Index k = 0; k < units.columns(); ++k)
  {
    copy_column(units, k, x);
    flow.offsets.without_held(x);
    const Vec part = x;
    without.entries.col(k) = columns_of(std::span(&part, 1)).entries;
  }
  const auto [parts, directions] = solve_dense_symmetric(inner_products(units, without)); // a projector
  return combination(units, directions.rightCols((parts.array() > 0.5).count()));
}

} // namespace

WholeSpace whole_space(const Flow& flow, double period)
{
  constexpr double rounding = 1e-14; // of the largest mass
  const MultiVector U = displacements_without_held(flow);
  const auto [masses, directions] = solve_dense_symmetric(inner_products(U, product(flow.M, U)));
  const Eigen::Index n = masses.size(), with_mass = (masses.array() > rounding * masses.maxCoeff()).count();
  const MultiVector V = with_mass == n ? U : combination(U, directions.rightCols(with_mass));
  const Eigen::Index rows = U.entries.rows();
  StateBlock unit{{U.comm, Eigen::MatrixXd::Zero(rows, n + with_mass)},
                  {U.comm, Eigen::MatrixXd::Zero(rows, n + with_mass)}};
  unit.u.entries.leftCols(n) = U.entries;
  unit.v.entries.rightCols(with_mass) = V.entries;
  WholeSpace space{unit, std::move(unit)};
  space.right.v.entries *= two_pi / period;
  space.left.v.entries *= period / two_pi;
  return space;
}

} // namespace squeal
