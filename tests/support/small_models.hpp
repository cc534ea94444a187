#pragma once
/// Small structures with a contact interface, given by dense matrices, for tests: the same on any number of ranks.
#include "squeal/contact/interface.hpp"

#include <algorithm>
#include <vector>

namespace squeal::test
{

/// Row-major dense matrix written as its rows.
using Rows = std::vector<std::vector<double>>;

struct SmallModel
{
  Structure structure;
  Interface interface;
};

inline Rows zeros(std::size_t rows, std::size_t columns)
{
  return Rows(rows, std::vector<double>(columns, 0.));
}

inline Rows diagonal(const std::vector<double>& values)
{
  Rows result = zeros(values.size(), values.size());
  for (std::size_t i = 0; i < values.size(); ++i) result[i][i] = values[i];
  return result;
}

/// AIJ with the entries of `values` where `pattern` (of the same shape) is not zero.
inline Owned<Mat> sparse(const Rows& values, const Rows& pattern)
{
  const auto columns = static_cast<PetscInt>(values.empty() ? 0 : values[0].size());
  Owned<Mat> result;
  check(MatCreateAIJ(PETSC_COMM_WORLD, PETSC_DECIDE, PETSC_DECIDE, static_cast<PetscInt>(values.size()), columns,
                     columns, nullptr, columns, nullptr, result.put()));
  check(MatSetOption(result, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(result, &first, &last));
  for (PetscInt i = first; i < last; ++i)
    for (PetscInt j = 0; j < columns; ++j)
    {
      const auto row = static_cast<std::size_t>(i), column = static_cast<std::size_t>(j);
      if (pattern[row][column] != 0) check(MatSetValue(result, i, j, values[row][column], INSERT_VALUES));
    }
  check(MatAssemblyBegin(result, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(result, MAT_FINAL_ASSEMBLY));
  return result;
}

inline Owned<Vec> vector_like(Mat matrix, const std::vector<double>& values)
{
  Owned<Vec> result;
  check(MatCreateVecs(matrix, result.put(), nullptr));
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(result, &first, &last));
  for (PetscInt i = first; i < last; ++i)
    check(VecSetValue(result, i, values[static_cast<std::size_t>(i)], INSERT_VALUES));
  check(VecAssemblyBegin(result));
  check(VecAssemblyEnd(result));
  return result;
}

/// M, C and K on one common pattern, which always holds the diagonal.
inline Structure make_structure(const Rows& M, const Rows& C, const Rows& K, const std::vector<double>& load)
{
  Rows pattern = diagonal(std::vector<double>(M.size(), 1.));
  for (std::size_t i = 0; i < M.size(); ++i)
    for (std::size_t j = 0; j < M.size(); ++j)
      if (M[i][j] != 0 || C[i][j] != 0 || K[i][j] != 0) pattern[i][j] = 1;
  Structure structure;
  structure.M = sparse(M, pattern);
  structure.C = sparse(C, pattern);
  structure.K = sparse(K, pattern);
  for (Mat matrix : {structure.M.get(), structure.C.get(), structure.K.get()})
    check(MatSetOption(matrix, MAT_SYMMETRIC, PETSC_TRUE));
  structure.load = vector_like(structure.K, load);
  return structure;
}

/// `B`: rows n, t (, t2) of every pair; `drive`: v_d, `directions` entries a pair.
inline Interface make_interface(const Rows& B, int directions, const std::vector<double>& gap,
                                const std::vector<double>& drive, double friction, Mat K)
{
  Interface interface;
  interface.pairs = static_cast<int>(gap.size());
  interface.directions = directions;
  interface.gap = gap;
  interface.drive = drive;
  interface.friction.common.coefficient = friction;
  PetscInt first = 0, last = 0, columns = 0, own_columns = 0;
  check(MatGetSize(K, nullptr, &columns));
  check(MatGetLocalSize(K, nullptr, &own_columns));
  check(MatCreateAIJ(PETSC_COMM_WORLD, PETSC_DECIDE, own_columns, static_cast<PetscInt>(B.size()), columns, columns,
                     nullptr, columns, nullptr, interface.B.put()));
  check(MatGetOwnershipRange(interface.B, &first, &last));
  for (PetscInt i = first; i < last; ++i)
    for (PetscInt j = 0; j < columns; ++j)
    {
      const double value = B[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
      if (value != 0) check(MatSetValue(interface.B, i, j, value, INSERT_VALUES));
    }
  check(MatAssemblyBegin(interface.B, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(interface.B, MAT_FINAL_ASSEMBLY));
  return interface;
}

/// Pad (x, y1) of mass 1 pressed on a disc (y2) of mass 0.5, with unilateral contact and plane friction on a belt of
/// speed V. It is the smallest system that squeals, lifts off, sticks and slips.
inline SmallModel unilateral_oscillator(double friction, double belt_speed)
{
  SmallModel model;
  model.structure = make_structure(diagonal({1, 1, 0.5}), diagonal({0.02, 0.02, 0.02}),
                                   {{1.1, -0.1, 0}, {-0.1, 0.5, 0}, {0, 0, 1.2}}, {0, -1, 0});
  model.interface = make_interface({{0, 1, -1}, {1, 0, 0}}, 1, {0}, {belt_speed}, friction, model.structure.K);
  return model;
}

/// N masses on a line with springs `stiffness` between neighbours and none to ground. Mass 0 faces the rigid ground
/// below it at distance `gap`. Both ends have half masses: a bar of N - 1 elements with lumped mass. There is no
/// friction and no tangential motion (an immovable direction). `load`: force on every unit of mass.
inline SmallModel mass_spring_chain(int count, double mass, double stiffness, double gap, double load)
{
  const auto n = static_cast<std::size_t>(count);
  Rows K = zeros(n, n);
  std::vector<double> masses(n, mass);
  if (n > 1) masses.front() = masses.back() = mass / 2;
  for (std::size_t i = 0; i + 1 < n; ++i)
  {
    K[i][i] += stiffness;
    K[i + 1][i + 1] += stiffness;
    K[i][i + 1] = K[i + 1][i] = -stiffness;
  }
  std::vector<double> forces(n);
  std::transform(masses.begin(), masses.end(), forces.begin(), [=](double m) { return m * load; });
  SmallModel model;
  model.structure = make_structure(diagonal(masses), zeros(n, n), K, forces);
  Rows B = zeros(2, n);
  B[0][0] = 1;
  model.interface = make_interface(B, 1, {gap}, {1}, 0, model.structure.K);
  return model;
}

} // namespace squeal::test
