#include "squeal/equilibrium/file_order.hpp"

#include <algorithm>
#include <numeric>

namespace squeal
{

FileOrder::FileOrder(const Structure& structure)
{
  const Vec x = structure.load;
  PetscInt size = 0;
  check(VecGetSize(x, &size));
  if (rank_of(comm_of(x)) != 0) size = 0;
  std::vector<PetscInt> order(static_cast<std::size_t>(size));
  std::iota(order.begin(), order.end(), 0);
  const std::vector<PetscInt>& nodal_dof = structure.names.nodal_dof;
  if (!nodal_dof.empty()) // the partition numbers the degrees of freedom of a mesh
    std::sort(order.begin(), order.end(), [&](PetscInt a, PetscInt b) { return nodal_dof[a] < nodal_dof[b]; });
  Owned<IS> from, to;
  check(ISCreateGeneral(PETSC_COMM_SELF, size, order.data(), PETSC_COPY_VALUES, from.put()));
  check(ISCreateStride(PETSC_COMM_SELF, size, 0, 1, to.put()));
  check(VecCreateSeq(PETSC_COMM_SELF, size, whole_.put()));
  check(VecScatterCreate(x, from, whole_, to, scatter_.put()));
}

std::vector<double> FileOrder::gather(Vec x) const
{
  check(VecScatterBegin(scatter_, x, whole_, INSERT_VALUES, SCATTER_FORWARD));
  check(VecScatterEnd(scatter_, x, whole_, INSERT_VALUES, SCATTER_FORWARD));
  PetscInt size = 0;
  const PetscScalar* values = nullptr;
  check(VecGetLocalSize(whole_, &size));
  check(VecGetArrayRead(whole_, &values));
  std::vector<double> entries(values, values + size);
  check(VecRestoreArrayRead(whole_, &values));
  return entries;
}

void FileOrder::scatter(std::span<const double> entries, Vec x) const
{
  PetscInt size = 0; // 0 but on rank 0
  PetscScalar* values = nullptr;
  check(VecGetLocalSize(whole_, &size));
  check(VecGetArrayWrite(whole_, &values));
  std::copy_n(entries.begin(), size, values);
  check(VecRestoreArrayWrite(whole_, &values));
  check(VecScatterBegin(scatter_, whole_, x, INSERT_VALUES, SCATTER_REVERSE));
  check(VecScatterEnd(scatter_, whole_, x, INSERT_VALUES, SCATTER_REVERSE));
}

void FileOrder::describe(Checkpoint& checkpoint, Vec x) const
{
  std::vector<double> entries;
  if (!checkpoint.reads()) entries = gather(x);
  squeal::describe(checkpoint, entries);
  if (checkpoint.reads()) scatter(entries, x);
}

} // namespace squeal
