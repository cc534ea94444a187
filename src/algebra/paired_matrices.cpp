#include "squeal/algebra/paired_matrices.hpp"

#include "sparse_product.hpp"
#include "squeal/algebra/panel.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

using Two = double __attribute__((vector_size(16)));

/// Entries of both matrices at x_j = (v_j, u_j). Without fused products, so that K u of a body that moves without
/// strain is zero to the last bit.
Two entry_times(const std::array<double, 2>& value, const Two* x)
{
  Two entry;
  std::memcpy(&entry, &value, sizeof entry);
  return entry * *x;
}

/// y += A x of this rank's own columns, which are stored from the diagonal on.
void add_own(const PairedRows& matrices, const Two* x, Two* y)
{
  for (std::size_t i = 0; i + 1 < matrices.starts.size(); ++i)
  {
    const auto first = static_cast<std::size_t>(matrices.starts[i]),
               end = static_cast<std::size_t>(matrices.starts[i + 1]);
    Two sum = y[i] + entry_times(matrices.values[first], x + i);
    for (std::size_t k = first + 1; k < end; ++k)
    {
      const PetscInt j = matrices.columns[k];
      sum += entry_times(matrices.values[k], x + j);
      y[j] += entry_times(matrices.values[k], x + i);
    }
    y[i] = sum;
  }
}

/// y += A x of other ranks' columns.
void add_foreign(const PairedRows& matrices, const Two* x, Two* y)
{
  for (std::size_t i = 0; i + 1 < matrices.starts.size(); ++i)
    for (auto k = static_cast<std::size_t>(matrices.starts[i]); k < static_cast<std::size_t>(matrices.starts[i + 1]);
         ++k)
      y[i] += entry_times(matrices.values[k], x + matrices.columns[k]);
}

/// Columns of other ranks in this rank's rows, ascending.
std::vector<PetscInt> foreign_columns(Mat M, Mat K)
{
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(M, &first, &last));
  std::vector<PetscInt> columns;
  for (Mat A : {M, K})
    for_each_row(A,
                 [&](PetscInt, std::span<const PetscInt> of_row, std::span<const PetscScalar>)
                 {
                   for (const PetscInt j : of_row)
                     if (j < first || j >= last) columns.push_back(j);
                 });
  std::sort(columns.begin(), columns.end());
  columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
  return columns;
}

/// The exchange that brings these rows of other ranks. Collective.
Owned<PetscSF> exchange_of(const std::vector<PetscInt>& wanted, Mat A)
{
  PetscLayout rows = nullptr;
  check(MatGetLayouts(A, &rows, nullptr));
  Owned<PetscSF> exchange;
  check(PetscSFCreate(comm_of(A), exchange.put()));
  check(PetscSFSetGraphLayout(exchange, rows, static_cast<PetscInt>(wanted.size()), nullptr, PETSC_COPY_VALUES,
                              wanted.data()));
  return exchange;
}

/// Appends rows of two matrices side by side.
class RowJoiner
{
public:
  RowJoiner(PairedRows& rows, std::size_t columns) : rows_(rows), place_(columns, 0) {}

  void add(PetscInt column, std::size_t which, double value)
  {
    PetscInt& here = place_[static_cast<std::size_t>(column)]; // one more than where the column's last entry is
    if (here <= rows_.starts.back())
    {
      rows_.columns.push_back(column);
      rows_.values.push_back({});
      here = static_cast<PetscInt>(rows_.columns.size());
    }
    rows_.values[static_cast<std::size_t>(here) - 1][which] += value;
  }

  void end_row() { rows_.starts.push_back(static_cast<PetscInt>(rows_.columns.size())); }

private:
  PairedRows& rows_;
  std::vector<PetscInt> place_;
};

} // namespace

std::optional<PairedMatrices> pair_matrices(Mat M, Mat K)
{
  if (!is_sparse(M) || !is_sparse(K)) return std::nullopt;
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(M, &first, &last));
  const std::vector<PetscInt> others = foreign_columns(M, K);
  PairedMatrices matrices{comm_of(M), {}, {}, others.size(), exchange_of(others, M)};
  RowJoiner own(matrices.own, static_cast<std::size_t>(last - first)), foreign(matrices.foreign, others.size());
  const auto enter = [&](Mat A, PetscInt i, std::size_t which)
  {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    check(MatGetRow(A, i, &count, &columns, &values));
    for (PetscInt k = 0; k < count; ++k)
      if (columns[k] < first || columns[k] >= last)
        foreign.add(static_cast<PetscInt>(std::lower_bound(others.begin(), others.end(), columns[k]) - others.begin()),
                    which, values[k]);
      else if (columns[k] >= i)
        own.add(columns[k] - first, which, values[k]);
    check(MatRestoreRow(A, i, &count, &columns, &values));
  };
  for (PetscInt i = first; i < last; ++i)
  {
    own.add(i - first, 0, 0.); // a row begins with its diagonal entry, be it zero
    enter(M, i, 0);
    enter(K, i, 1);
    own.end_row();
    foreign.end_row();
  }
  return matrices;
}

void multiply_both(const PairedMatrices& matrices, const std::array<Vec, 2>& of, const std::array<Vec, 2>& to)
{
  const std::size_t rows = matrices.own.starts.size() - 1;
  std::vector<Two> x(rows), y(rows, Two{}), z(matrices.received);
  for (std::size_t part = 0; part < 2; ++part)
  {
    const PetscScalar* from = nullptr;
    check(VecGetArrayRead(of[part], &from));
    for (std::size_t i = 0; i < rows; ++i) x[i][part] = from[i];
    check(VecRestoreArrayRead(of[part], &from));
  }
  add_own(matrices.own, x.data(), y.data());
  if (ranks_of(matrices.comm) > 1)
  {
    const RowType row(2);
    check(PetscSFBcastBegin(matrices.exchange, row.type, x.data(), z.data(), MPI_REPLACE));
    check(PetscSFBcastEnd(matrices.exchange, row.type, x.data(), z.data(), MPI_REPLACE));
    add_foreign(matrices.foreign, z.data(), y.data());
  }
  for (std::size_t part = 0; part < 2; ++part)
  {
    PetscScalar* result = nullptr;
    check(VecGetArrayWrite(to[part], &result));
    for (std::size_t i = 0; i < rows; ++i) result[i] = y[i][part];
    check(VecRestoreArrayWrite(to[part], &result));
  }
}

} // namespace squeal
