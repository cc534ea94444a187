#include "whole_matrix.hpp"

#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/constants.hpp"

namespace squeal
{

namespace
{

void add_entry(Vec part, PetscInt row, double value)
{
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(part, &first, &last));
  if (row >= first && row < last) check(VecSetValue(part, row, value, INSERT_VALUES));
  check(VecAssemblyBegin(part));
  check(VecAssemblyEnd(part));
}

/// Orthonormal columns that span the displacements without the offsets held in the period recorded last.
Eigen::MatrixXd displacements_without_held(const Flow& flow)
{
  PetscInt n = 0;
  check(MatGetSize(flow.M, &n, nullptr));
  Eigen::MatrixXd projector = Eigen::MatrixXd::Identity(n, n);
  if (!flow.offsets.without_held) return projector;
  for (PetscInt k = 0; k < n; ++k)
  {
    Owned<Vec> x;
    check(MatCreateVecs(flow.M, x.put(), nullptr));
    add_entry(x, k, 1);
    flow.offsets.without_held(x);
    const std::vector<double> column = all_entries(x);
    projector.col(k) = Eigen::VectorXd::Map(column.data(), n);
  }
  const auto [parts, directions] = solve_dense_symmetric(projector);
  return directions.rightCols((parts.array() > 0.5).count());
}

} // namespace

Eigen::VectorXd coordinates_of(Vec state, double period)
{
  const std::vector<double> u = all_entries(displacement(state)), v = all_entries(velocity(state));
  Eigen::VectorXd all(static_cast<Eigen::Index>(u.size() + v.size()));
  all << Eigen::VectorXd::Map(u.data(), static_cast<Eigen::Index>(u.size())),
      Eigen::VectorXd::Map(v.data(), static_cast<Eigen::Index>(v.size())) * (period / two_pi);
  return all;
}

Owned<Vec> state_at(const Eigen::VectorXd& coordinates, const Orbit& orbit)
{
  Owned<Vec> state = zeros_like(orbit.state);
  const auto dofs = static_cast<PetscInt>(coordinates.size() / 2);
  for (PetscInt i = 0; i < 2 * dofs; ++i)
    if (coordinates(i) != 0)
      add_entry(i < dofs ? displacement(state) : velocity(state), i % dofs,
                coordinates(i) * (i < dofs ? 1 : two_pi / orbit.period));
  return state;
}

Eigen::MatrixXd coordinates_with_mass(const Flow& flow)
{
  constexpr double rounding = 1e-14; // of the largest mass
  const Eigen::MatrixXd U = displacements_without_held(flow);
  const auto [masses, directions] = solve_dense_symmetric(U.transpose() * dense_copy(flow.M) * U);
  const Eigen::Index n = masses.size(), with_mass = (masses.array() > rounding * masses.maxCoeff()).count();
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(2 * U.rows(), n + with_mass);
  result.topLeftCorner(U.rows(), n) = U;
  result.bottomRightCorner(U.rows(), with_mass) = with_mass == n ? U : U * directions.rightCols(with_mass);
  return result;
}

Eigen::MatrixXd whole_matrix(const Orbit& orbit, const std::function<void(std::span<const Owned<Vec>>)>& multiply)
{
  const PetscInt dofs = dofs_of(orbit.state);
  Eigen::MatrixXd M(2 * dofs, 2 * dofs);
  std::vector<Owned<Vec>> columns;
  for (PetscInt k = 0; k < 2 * dofs; ++k) columns.push_back(state_at(Eigen::VectorXd::Unit(2 * dofs, k), orbit));
  multiply(columns);
  for (PetscInt k = 0; k < 2 * dofs; ++k) M.col(k) = coordinates_of(columns[static_cast<std::size_t>(k)], orbit.period);
  return M;
}

} // namespace squeal
