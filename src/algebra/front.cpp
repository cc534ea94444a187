#include "front.hpp"

#include <petscblaslapack.h>

namespace squeal
{

Columns ordered(const Triplets& lower, const SymbolicFactor& symbolic)
{
  const std::size_t count = lower.row.size();
  Columns columns;
  columns.starts.assign(at(symbolic.dofs) + 1, 0);
  columns.rows.resize(count);
  columns.values.resize(count);
  for (std::size_t k = 0; k < count; ++k) ++columns.starts[at(place_of(lower, k, symbolic).second) + 1];
  for (std::size_t j = 0; j < at(symbolic.dofs); ++j) columns.starts[j + 1] += columns.starts[j];
  std::vector<std::size_t> next(columns.starts.begin(), columns.starts.end() - 1);
  for (std::size_t k = 0; k < count; ++k)
  {
    const auto [row, column] = place_of(lower, k, symbolic);
    const std::size_t here = next[at(column)]++;
    columns.rows[here] = row;
    columns.values[here] = lower.value[k];
  }
  return columns;
}

std::size_t front_size(const Supernode& supernode)
{
  return at(supernode.height()) * at(supernode.columns + supernode.inner());
}

std::size_t update_size(const Supernode& supernode)
{
  return at(supernode.inner()) * at(supernode.below);
}

void assemble(const Front& front, const Columns& A, std::vector<int>& local)
{
  const std::size_t first = at(front.supernode.first), pivots = front.pivots();
  std::fill_n(front.values, front_size(front.supernode), 0.);
  for (std::size_t j = 0; j < pivots; ++j) local[first + j] = static_cast<int>(j);
  for (std::size_t i = 0; i < at(front.supernode.below); ++i) local[at(front.below[i])] = static_cast<int>(pivots + i);
  for (std::size_t j = 0; j < pivots; ++j)
    for (std::size_t k = A.starts[first + j]; k < A.starts[first + j + 1]; ++k)
      if (const int row = local[at(A.rows[k])]; row >= 0) front.column(j)[row] += A.values[k];
}

void add_update(const Front& front, const Update& update, const std::vector<int>& local)
{
  const std::size_t below = update.below.size();
  for (std::size_t j = 0; j < update.inner; ++j)
  {
    double* const column = front.column(at(local[at(update.below[j])]));
    const double* const from = update.values + j * below;
    for (std::size_t i = j; i < below; ++i)
      if (const int row = local[at(update.below[i])]; row >= 0) column[row] += from[i];
  }
}

void copy_update(const Front& front, double* to)
{
  const std::size_t pivots = front.pivots(), below = at(front.supernode.below);
  for (std::size_t j = 0; j < at(front.supernode.inner()); ++j, to += below)
    std::copy_n(front.column(pivots + j) + pivots, below, to);
}

bool eliminate_pivots(const Front& front)
{
  PetscBLASInt n = static_cast<PetscBLASInt>(front.height()), pivots = front.supernode.columns,
               below = front.supernode.below, inner = front.supernode.inner(), border = front.supernode.border,
               info = 0;
  const double one = 1, minus = -1;
  double *L = front.values, *lower = L + pivots, *update = L + at(pivots) * at(n) + pivots;
  LAPACKpotrf_("L", &pivots, L, &n, &info);
  if (info != 0) return false;
  if (below > 0) BLAStrsm_("R", "L", "T", "N", &below, &pivots, &one, L, &n, lower, &n);
  if (inner == 0) return true;
  BLASsyrk_("L", "N", &inner, &pivots, &minus, lower, &n, &one, update, &n);
  if (border > 0)
    BLASgemm_("N", "T", &border, &inner, &pivots, &minus, lower + inner, &n, lower, &n, &one, update + inner, &n);
  return true;
}

} // namespace squeal
