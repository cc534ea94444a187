#include "squeal/algebra/paired_matrices.hpp"

#include "squeal/algebra/panel.hpp"
#include "squeal/algebra/simd.hpp"

#include <cstring>

namespace squeal
{

namespace
{

using Two = double __attribute__((vector_size(16)));
using Four = double __attribute__((vector_size(32)));
using Eight = double __attribute__((vector_size(64)));

/// y += A x for the upper triangles of symmetric matrices. With two parts an Entry belongs to one matrix, and a row of
/// x holds v and then u of all trajectories. With one part an Entry holds those of both, and a row of x is (v, u).
template <std::size_t parts, class Entry, class Vector>
SQUEAL_INLINE void add_product(const PairedMatrices& matrices, const double* x, double* y)
{
  constexpr std::size_t width = sizeof(Vector) / sizeof(double), stride = parts * width;
  const PetscInt* const columns = matrices.columns.data();
  const std::array<double, 2>* const values = matrices.values.data();
  Entry entry;
  Vector own[parts], sums[parts], other;
  for (std::size_t i = 0; i + 1 < matrices.starts.size(); ++i)
  {
    const auto first = static_cast<std::size_t>(matrices.starts[i]),
               end = static_cast<std::size_t>(matrices.starts[i + 1]);
    for (std::size_t part = 0; part < parts; ++part)
    {
      std::memcpy(&own[part], x + i * stride + part * width, sizeof other);
      std::memcpy(&sums[part], y + i * stride + part * width, sizeof other);
      std::memcpy(&entry, &values[first][part], sizeof entry); // on the diagonal
      sums[part] += entry * own[part];
    }
    for (std::size_t k = first + 1; k < end; ++k)
      for (std::size_t part = 0; part < parts; ++part)
      {
        const std::size_t j = static_cast<std::size_t>(columns[k]) * stride + part * width;
        std::memcpy(&entry, &values[k][part], sizeof entry);
        std::memcpy(&other, x + j, sizeof other);
        sums[part] += entry * other;
        std::memcpy(&other, y + j, sizeof other);
        other += entry * own[part];
        std::memcpy(y + j, &other, sizeof other);
      }
    for (std::size_t part = 0; part < parts; ++part)
      std::memcpy(y + i * stride + part * width, &sums[part], sizeof other);
  }
}

/// One trajectory. Without fused products K u of a body that moves without strain is zero to the last bit.
void add_both(const PairedMatrices& matrices, const double* x, double* y)
{
  add_product<1, Two, Two>(matrices, x, y);
}

/// 4 or 8 trajectories.
SQUEAL_SIMD void add_products(const PairedMatrices& matrices, std::size_t count, const double* x, double* y)
{
  count == 4 ? add_product<2, double, Four>(matrices, x, y) : add_product<2, double, Eight>(matrices, x, y);
}

bool is_sequential_sparse(Mat A)
{
  PetscBool sparse = PETSC_FALSE;
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(A), MATSEQAIJ, &sparse));
  return sparse;
}

} // namespace

std::optional<PairedMatrices> pair_matrices(Mat M, Mat K)
{
  if (!is_sequential_sparse(M) || !is_sequential_sparse(K)) return std::nullopt;
  PetscInt rows = 0;
  check(MatGetSize(M, &rows, nullptr));
  PairedMatrices matrices{{0}, {}, {}};
  std::vector<PetscInt> place(static_cast<std::size_t>(rows), 0); // one more than where a column's last entry is
  const auto enter = [&](Mat A, PetscInt i, std::size_t which)
  {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    check(MatGetRow(A, i, &count, &columns, &values));
    for (PetscInt k = 0; k < count; ++k)
    {
      if (columns[k] < i) continue;
      PetscInt& here = place[static_cast<std::size_t>(columns[k])];
      if (here <= matrices.starts.back())
      {
        matrices.columns.push_back(columns[k]);
        matrices.values.push_back({});
        here = static_cast<PetscInt>(matrices.columns.size());
      }
      matrices.values[static_cast<std::size_t>(here) - 1][which] = values[k];
    }
    check(MatRestoreRow(A, i, &count, &columns, &values));
  };
  for (PetscInt i = 0; i < rows; ++i)
  {
    // a row begins with its diagonal entry, be it zero
    place[static_cast<std::size_t>(i)] = static_cast<PetscInt>(matrices.columns.size()) + 1;
    matrices.columns.push_back(i);
    matrices.values.push_back({});
    enter(M, i, 0);
    enter(K, i, 1);
    matrices.starts.push_back(static_cast<PetscInt>(matrices.columns.size()));
  }
  return matrices;
}

void multiply_both(const PairedMatrices& matrices, std::span<const Vec> v, std::span<const Vec> u,
                   std::span<const Vec> Mv, std::span<const Vec> Ku)
{
  const std::size_t rows = matrices.starts.size() - 1, lanes = std::min<std::size_t>(8, lanes_for(v.size()));
  std::vector<double> x(2 * lanes * rows), y;
  for (std::size_t first = 0; first < v.size(); first += lanes)
  {
    const std::size_t count = std::min(lanes, v.size() - first);
    std::vector<const double*> from(2 * count);
    std::vector<double*> to(2 * count);
    for (std::size_t k = 0; k < count; ++k)
    {
      check(VecGetArrayRead(v[first + k], &from[k]));
      check(VecGetArrayRead(u[first + k], &from[count + k]));
      check(VecGetArrayWrite(Mv[first + k], &to[k]));
      check(VecGetArrayWrite(Ku[first + k], &to[count + k]));
    }
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t k = 0; k < 2 * count; ++k) x[i * 2 * lanes + k / count * lanes + k % count] = from[k][i];
    y.assign(x.size(), 0.);
    lanes == 1 ? add_both(matrices, x.data(), y.data()) : add_products(matrices, lanes, x.data(), y.data());
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t k = 0; k < 2 * count; ++k) to[k][i] = y[i * 2 * lanes + k / count * lanes + k % count];
    for (std::size_t k = 0; k < count; ++k)
    {
      check(VecRestoreArrayRead(v[first + k], &from[k]));
      check(VecRestoreArrayRead(u[first + k], &from[count + k]));
      check(VecRestoreArrayWrite(Mv[first + k], &to[k]));
      check(VecRestoreArrayWrite(Ku[first + k], &to[count + k]));
    }
  }
}

} // namespace squeal
