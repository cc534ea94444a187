#include "squeal/algebra/sparse_matrices.hpp"
#include "squeal/algebra/panel.hpp"

#include <algorithm>
#include <petscsf.h>

namespace squeal
{

namespace
{

using Two = double __attribute__((vector_size(16)));

/// The rows of a matrix on one rank, lent for as long as the object lives.
class CompressedRows
{
public:
  explicit CompressedRows(Mat A) : A_(A)
  {
    PetscBool done = PETSC_FALSE;
    check(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &rows, &starts, &columns, &done));
    check(MatSeqAIJGetArrayRead(A, &values));
  }
  ~CompressedRows()
  {
    PetscBool done = PETSC_FALSE;
    (void)MatSeqAIJRestoreArrayRead(A_, &values);
    (void)MatRestoreRowIJ(A_, 0, PETSC_FALSE, PETSC_FALSE, &rows, &starts, &columns, &done);
  }
  CompressedRows(const CompressedRows&) = delete;
  CompressedRows& operator=(const CompressedRows&) = delete;

  PetscInt rows = 0;
  const PetscInt *starts = nullptr, *columns = nullptr;
  const PetscScalar* values = nullptr;

private:
  Mat A_;
};

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

/// Appends row i of two matrices of one pattern, from a column on; whether it has that column.
bool append_row(const CompressedRows& M, const CompressedRows& K, PetscInt i, PetscInt first, PairedRows& rows)
{
  const std::size_t before = rows.columns.size();
  for (PetscInt k = M.starts[i]; k < M.starts[i + 1]; ++k)
  {
    if (M.columns[k] < first) continue;
    rows.columns.push_back(M.columns[k]);
    rows.values.push_back({M.values[k], K.values[k]});
  }
  rows.starts.push_back(static_cast<PetscInt>(rows.columns.size()));
  return rows.columns.size() > before && rows.columns[before] == first;
}

bool have_one_pattern(const CompressedRows& M, const CompressedRows& K)
{
  return std::equal(M.starts, M.starts + M.rows + 1, K.starts) &&
         std::equal(M.columns, M.columns + M.starts[M.rows], K.columns);
}

} // namespace

std::optional<PairedMatrices> pair_matrices(Mat M, Mat K)
{
  if (!is_sparse(M) || !is_sparse(K)) return std::nullopt;
  PairedMatrices matrices{comm_of(M), {}, {}, 0, {}};
  int alike = 1; // on all ranks
  const auto join = [&](Mat left, Mat right, PairedRows& rows, bool upper)
  {
    const CompressedRows m(left), k(right);
    alike = alike && have_one_pattern(m, k);
    for (PetscInt i = 0; alike && i < m.rows; ++i)
      alike = append_row(m, k, i, upper ? i : 0, rows) || !upper; // a row begins with its diagonal entry
  };
  if (ranks_of(matrices.comm) == 1)
    join(M, K, matrices.own, true);
  else
  {
    Mat own_M = nullptr, own_K = nullptr, foreign_M = nullptr, foreign_K = nullptr;
    const PetscInt* places = nullptr; // of the foreign columns
    PetscLayout layout = nullptr;
    check(MatMPIAIJGetSeqAIJ(K, &own_K, &foreign_K, nullptr));
    check(MatMPIAIJGetSeqAIJ(M, &own_M, &foreign_M, &places));
    join(own_M, own_K, matrices.own, true);
    join(foreign_M, foreign_K, matrices.foreign, false);
    matrices.received = static_cast<std::size_t>(column_count(foreign_M));
    check(MatGetLayouts(M, nullptr, &layout));
    check(PetscSFCreate(matrices.comm, matrices.exchange.put()));
    check(
        PetscSFSetGraphLayout(matrices.exchange, layout, column_count(foreign_M), nullptr, PETSC_COPY_VALUES, places));
  }
  MPI_Allreduce(MPI_IN_PLACE, &alike, 1, MPI_INT, MPI_LAND, matrices.comm);
  if (!alike) return std::nullopt;
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
    check(PetscSFBcastBegin(matrices.exchange, MPIU_2SCALAR, x.data(), z.data(), MPI_REPLACE));
    check(PetscSFBcastEnd(matrices.exchange, MPIU_2SCALAR, x.data(), z.data(), MPI_REPLACE));
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

bool is_sparse(Mat A)
{
  PetscBool sparse = PETSC_FALSE;
  check(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(A), &sparse, MATSEQAIJ, MATMPIAIJ, ""));
  return sparse;
}

} // namespace squeal
