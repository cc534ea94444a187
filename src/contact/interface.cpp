#include "squeal/contact/interface.hpp"

#include "squeal/solid/binary.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Rows of whole pairs on this rank.
PetscInt local_rows(PetscInt pairs, int block, MPI_Comm comm)
{
  const PetscInt ranks = ranks_of(comm), rank = rank_of(comm);
  return block * (pairs / ranks + (rank < pairs % ranks ? 1 : 0));
}

std::string where(const Interface& interface, int pair)
{
  std::string text = "pair " + std::to_string(pair);
  if (interface.position.empty()) return text;
  const Vec3& at = interface.position[static_cast<std::size_t>(pair)];
  return text + " at (" + std::to_string(at[0]) + ", " + std::to_string(at[1]) + ", " + std::to_string(at[2]) + ")";
}

/// Every pair must be able to feel a normal reaction, and must know where friction pulls it.
void check_interface(const Interface& interface, const std::string& source, MPI_Comm comm)
{
  std::string problem;
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(interface.B, &first, &last));
  const PetscInt block = interface.block();
  for (PetscInt row = first; row < last && problem.empty(); row += block)
  {
    PetscInt count = 0;
    const PetscScalar* values = nullptr;
    check(MatGetRow(interface.B, row, &count, nullptr, &values));
    const bool empty = std::all_of(values, values + count, [](double value) { return value == 0; });
    check(MatRestoreRow(interface.B, row, &count, nullptr, &values));
    if (empty)
      problem = source + ": " + where(interface, static_cast<int>(row / block)) +
                " cannot move along its normal: both sides are held still there, remove it from the contact";
  }
  agree(comm, problem);
  if (interface.friction == 0) return;
  const auto directions = drive_directions(interface);
  const auto width = static_cast<std::size_t>(interface.directions);
  for (std::size_t i = 0; i < directions.size(); i += width)
    if (std::all_of(&directions[i], &directions[i] + width, [](double value) { return value == 0; }))
      throw Error(source + ": " + where(interface, static_cast<int>(i / width)) +
                  " has no tangential drive velocity: friction has no direction there; give a velocity or move the " +
                  "axis of rotation, or set friction.coefficient = 0");
}

} // namespace

Interface read_interface(const std::filesystem::path& folder, const Structure& structure, const FrictionLaw& friction,
                         MPI_Comm comm)
{
  Interface interface;
  interface.friction = friction.coefficient;
  interface.direction_damping = friction.direction_damping;
  interface.gap = read_vector(folder / "gap.petsc", comm);
  interface.drive = read_vector(folder / "drive.petsc", comm);
  interface.pairs = static_cast<int>(interface.gap.size());
  const auto size = check_matrix_file(folder / "B.petsc", comm);
  PetscInt dofs = 0, local_dofs = 0;
  check(MatGetSize(structure.M, &dofs, nullptr));
  check(MatGetLocalSize(structure.M, &local_dofs, nullptr));
  const std::string B = (folder / "B.petsc").string();
  if (size.columns != dofs)
    throw Error(B + ": " + std::to_string(size.columns) + " columns, but M.petsc has " + std::to_string(dofs));
  if (size.rows != 2 * interface.pairs && size.rows != 3 * interface.pairs)
    throw Error(B + ": " + std::to_string(size.rows) + " rows for the " + std::to_string(interface.pairs) +
                " pairs of gap.petsc; each pair has its normal row and one or two tangential rows");
  interface.directions = static_cast<int>(size.rows) / interface.pairs - 1;
  if (interface.drive.size() != interface.gap.size() * static_cast<std::size_t>(interface.directions))
    throw Error((folder / "drive.petsc").string() + ": length " + std::to_string(interface.drive.size()) + " for " +
                std::to_string(interface.pairs) + " pairs with " + std::to_string(interface.directions) +
                " tangential row(s) each in B.petsc");
  interface.B = load_matrix(B, size, {local_rows(interface.pairs, interface.block(), comm), local_dofs}, comm);
  check_interface(interface, folder.string(), comm);
  return interface;
}

std::vector<double> relative(const Interface& interface, Vec x)
{
  Owned<Vec> rows;
  check(MatCreateVecs(interface.B, nullptr, rows.put()));
  check(MatMult(interface.B, x, rows));
  const auto comm = PetscObjectComm(reinterpret_cast<PetscObject>(interface.B.get()));
  const PetscInt* ranges = nullptr;
  check(MatGetOwnershipRanges(interface.B, &ranges));
  const auto ranks = static_cast<std::size_t>(ranks_of(comm));
  std::vector<int> counts(ranks), starts(ranks);
  for (std::size_t rank = 0; rank < ranks; ++rank)
  {
    starts[rank] = static_cast<int>(ranges[rank]);
    counts[rank] = static_cast<int>(ranges[rank + 1] - ranges[rank]);
  }
  std::vector<double> result(interface.size());
  const PetscScalar* mine = nullptr;
  check(VecGetArrayRead(rows, &mine));
  MPI_Allgatherv(mine, counts[static_cast<std::size_t>(rank_of(comm))], MPI_DOUBLE, result.data(), counts.data(),
                 starts.data(), MPI_DOUBLE, comm);
  check(VecRestoreArrayRead(rows, &mine));
  return result;
}

void add_reactions(const Interface& interface, const std::vector<double>& r, Vec y)
{
  Owned<Vec> rows;
  check(MatCreateVecs(interface.B, nullptr, rows.put()));
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(rows, &first, &last));
  PetscScalar* mine = nullptr;
  check(VecGetArrayWrite(rows, &mine));
  std::copy(r.begin() + first, r.begin() + last, mine);
  check(VecRestoreArrayWrite(rows, &mine));
  check(MatMultTransposeAdd(interface.B, rows, y, y));
}

std::vector<double> drive_directions(const Interface& interface)
{
  std::vector<double> directions = interface.drive;
  const auto width = static_cast<std::size_t>(interface.directions);
  for (std::size_t i = 0; i < directions.size(); i += width)
  {
    double speed = 0;
    for (std::size_t k = i; k < i + width; ++k) speed = std::hypot(speed, directions[k]);
    for (std::size_t k = i; k < i + width; ++k) directions[k] = speed > 0 ? directions[k] / speed : 0;
  }
  return directions;
}

} // namespace squeal
