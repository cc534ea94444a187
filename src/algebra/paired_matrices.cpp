#include "squeal/algebra/paired_matrices.hpp"

#include "registers.hpp"
#include "sparse_product.hpp"
#include "squeal/algebra/panel.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

using Two = double __attribute__((vector_size(16)));

/// The columns that PairedRows hold: a rank's own from the diagonal on, for their mirror images as well, or others'.
enum class ColumnsOf
{
  own,
  others
};

/// y += A x. With two parts an Entry belongs to one matrix, and a row of x holds v and then u of all trajectories, each
/// in so many Vectors. With one part and an Entry of two numbers a row of x is (v, u).
template <ColumnsOf which, std::size_t parts, class Entry, class Vector, std::size_t vectors>
SQUEAL_INLINE void add_product(const PairedRows& matrices, const double* x, double* y)
{
  constexpr std::size_t width = sizeof(Vector) / sizeof(double), stride = parts * vectors * width;
  constexpr bool mirrored = which == ColumnsOf::own;
  const PetscInt* const columns = matrices.columns.data();
  const std::array<double, 2>* const values = matrices.values.data();
  Entry entry;
  Vector own[parts * vectors], sums[parts * vectors], other;
  for (std::size_t i = 0; i + 1 < matrices.starts.size(); ++i)
  {
    const auto first = static_cast<std::size_t>(matrices.starts[i]),
               end = static_cast<std::size_t>(matrices.starts[i + 1]);
    if (first == end) continue;
    for (std::size_t n = 0; n < parts * vectors; ++n)
    {
      std::memcpy(&sums[n], y + i * stride + n * width, sizeof other);
      if constexpr (mirrored)
      {
        std::memcpy(&own[n], x + i * stride + n * width, sizeof other);
        std::memcpy(&entry, &values[first][n / vectors], sizeof entry); // on the diagonal
        sums[n] += entry * own[n];
      }
    }
    for (std::size_t k = mirrored ? first + 1 : first; k < end; ++k)
      for (std::size_t n = 0; n < parts * vectors; ++n)
      {
        const std::size_t j = static_cast<std::size_t>(columns[k]) * stride + n * width;
        std::memcpy(&entry, &values[k][n / vectors], sizeof entry);
        std::memcpy(&other, x + j, sizeof other);
        sums[n] += entry * other;
        if constexpr (mirrored)
        {
          std::memcpy(&other, y + j, sizeof other);
          other += entry * own[n];
          std::memcpy(y + j, &other, sizeof other);
        }
      }
    for (std::size_t n = 0; n < parts * vectors; ++n) std::memcpy(y + i * stride + n * width, &sums[n], sizeof other);
  }
}

/// 4 or 8 trajectories.
template <ColumnsOf which>
SQUEAL_INLINE void add_lanes(const PairedRows& matrices, std::size_t lanes, const double* x, double* y)
{
  if (lanes == 4)
    add_product<which, 2, double, Four, 1>(matrices, x, y);
  else if (SQUEAL_HAS_AVX512)
    add_product<which, 2, double, Eight, 1>(matrices, x, y);
  else
    add_product<which, 2, double, Four, 2>(matrices, x, y);
}

SQUEAL_SIMD void add_own(const PairedRows& matrices, std::size_t lanes, const double* x, double* y)
{
  add_lanes<ColumnsOf::own>(matrices, lanes, x, y);
}

SQUEAL_SIMD void add_others(const PairedRows& matrices, std::size_t lanes, const double* x, double* y)
{
  add_lanes<ColumnsOf::others>(matrices, lanes, x, y);
}

/// One trajectory without fused products: K u of a body that moves without strain is then zero to the last bit.
template <ColumnsOf which> void add(const PairedRows& matrices, std::size_t lanes, const double* x, double* y)
{
  if (lanes == 1)
    add_product<which, 1, Two, Two, 1>(matrices, x, y);
  else if (which == ColumnsOf::own)
    add_own(matrices, lanes, x, y);
  else
    add_others(matrices, lanes, x, y);
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

void multiply_both(const PairedMatrices& matrices, std::span<const Vec> v, std::span<const Vec> u,
                   std::span<const Vec> Mv, std::span<const Vec> Ku)
{
  constexpr std::size_t parts = 2;
  const std::array from{v, u}, to{Mv, Ku};
  const std::size_t rows = matrices.own.starts.size() - 1, lanes = std::min<std::size_t>(8, lanes_for(v.size())),
                    stride = parts * lanes;
  std::vector<double> x(stride * rows), y, z(stride * matrices.received);
  const RowType row(stride);
  for (std::size_t first = 0; first < from[0].size(); first += lanes)
  {
    const std::size_t count = std::min(lanes, from[0].size() - first);
    std::vector<const double*> read(parts * count);
    std::vector<double*> written(parts * count);
    for (std::size_t k = 0; k < parts * count; ++k)
    {
      check(VecGetArrayRead(from[k / count][first + k % count], &read[k]));
      check(VecGetArrayWrite(to[k / count][first + k % count], &written[k]));
    }
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t k = 0; k < parts * count; ++k) x[i * stride + k / count * lanes + k % count] = read[k][i];
    y.assign(x.size(), 0.);
    add<ColumnsOf::own>(matrices.own, lanes, x.data(), y.data());
    if (ranks_of(matrices.comm) > 1)
    {
      check(PetscSFBcastBegin(matrices.exchange, row.type, x.data(), z.data(), MPI_REPLACE));
      check(PetscSFBcastEnd(matrices.exchange, row.type, x.data(), z.data(), MPI_REPLACE));
      add<ColumnsOf::others>(matrices.foreign, lanes, z.data(), y.data());
    }
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t k = 0; k < parts * count; ++k) written[k][i] = y[i * stride + k / count * lanes + k % count];
    for (std::size_t k = 0; k < parts * count; ++k)
    {
      check(VecRestoreArrayRead(from[k / count][first + k % count], &read[k]));
      check(VecRestoreArrayWrite(to[k / count][first + k % count], &written[k]));
    }
  }
}

} // namespace squeal
