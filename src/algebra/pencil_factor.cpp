#include "squeal/algebra/pencil_factor.hpp"

#include "mumps.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/error.hpp"

#include <optional>

/// Every rank factors the whole of a matrix of moderate size and solves its part of the right-hand sides. Shared by
/// ranks, MUMPS adds up in the order in which messages arrive: results would change in rounding from run to run, and a
/// restarted run would not give the straight run's numbers. The factor of a larger one is shared.

namespace squeal
{

struct PencilFactor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  RowLayout layout;
  bool whole = false;      // whether every rank makes the whole factor
  Owned<Mat> K, M, pencil; // `pencil` has the entries of either
  std::optional<MumpsFactor> mumps;

  /// Runs what communicates inside of MUMPS only if the ranks share one instance. Where each has its own, all agree on
  /// failures.
  template <class Work> void run_together(Work work) const { whole ? on_every_rank(comm, work) : work(); }
};

namespace
{

constexpr double entry_bytes = sizeof(PetscScalar) + sizeof(PetscInt);

bool is_made_whole(double entries_of_K, const PencilOptions& options, MPI_Comm comm)
{
  return ranks_of(comm) > 1 && entry_bytes * entries_of_K <= 1e9 * options.whole_limit;
}

/// The matrix by rows, on every rank the whole of it or its own rows.
Owned<Mat> sparse_matrix(Mat A, bool whole)
{
  if (whole) return whole_copy(A);
  Owned<Mat> result;
  check(MatConvert(A, MATAIJ, MAT_INITIAL_MATRIX, result.put()));
  return result;
}

} // namespace

PencilFactor::PencilFactor(Mat K, Mat M, Symmetry symmetry, const PencilOptions& options)
    : parts_(std::make_unique<Parts>())
{
  Parts& parts = *parts_;
  parts.comm = comm_of(K);
  parts.layout = row_layout(K);
  MatInfo info;
  check(MatGetInfo(K, MAT_GLOBAL_SUM, &info));
  parts.whole = is_made_whole(info.nz_used, options, parts.comm);
  parts.K = sparse_matrix(K, parts.whole);
  parts.M = sparse_matrix(M, parts.whole);
  parts.pencil = copy_of(parts.K);
  check(MatAXPY(parts.pencil, 1, parts.M, DIFFERENT_NONZERO_PATTERN));
  const MumpsSettings settings{.symmetry = symmetry, .prefix = "modes_", .room = options.room};
  parts.run_together([&] { parts.mumps.emplace(parts.pencil, settings); });
}

PencilFactor::~PencilFactor() = default;

double forecast_pencil(const FactorForecast& forecast, double entries_of_K, Symmetry symmetry,
                       const PencilOptions& options, MPI_Comm comm)
{
  const bool symmetric = symmetry == Symmetry::symmetric;
  const double numbers = symmetric ? forecast.symmetric : forecast.not_symmetric;
  const double copies = is_made_whole(entries_of_K, options, comm) ? ranks_of(comm) : 1;
  // K, M and K - shift M; of the last one the lower half or all with its places in MUMPS, and once more in its order
  const double an_entry = 3 * entry_bytes + (symmetric ? 0.5 : 1) * (4 * sizeof(int) + 2 * sizeof(double));
  return copies * (an_entry * entries_of_K + sizeof(double) * numbers);
}

bool PencilFactor::factorise(double shift)
{
  Parts& parts = *parts_;
  check(MatZeroEntries(parts.pencil));
  check(MatAXPY(parts.pencil, 1, parts.K, SUBSET_NONZERO_PATTERN));
  check(MatAXPY(parts.pencil, -shift, parts.M, SUBSET_NONZERO_PATTERN));
  bool regular = false;
  parts.run_together([&] { regular = parts.mumps->factorise(); });
  return regular;
}

int PencilFactor::negative_pivots() const
{
  return parts_->mumps->negative_pivots();
}

MultiVector PencilFactor::solve(const MultiVector& X) const
{
  return solve_with(X, [&](const Eigen::MatrixXd& B) { return parts_->mumps->solve(B); });
}

MultiVector PencilFactor::solve_transposed(const MultiVector& X) const
{
  return solve_with(X, [&](const Eigen::MatrixXd& B) { return parts_->mumps->solve_transposed(B); });
}

/// With a whole factor on every rank each solves some of the columns.
template <class Solve> MultiVector PencilFactor::solve_with(const MultiVector& X, const Solve& solution_of) const
{
  const Parts& parts = *parts_;
  if (X.columns() == 0) return X;
  if (!parts.whole) return {X.comm, solution_of(X.entries)};
  MultiVector Y = X;
  const int rows = to_int(Y.entries.rows()), columns = to_int(Y.columns()), rank = rank_of(parts.comm),
            ranks = ranks_of(parts.comm);
  Eigen::MatrixXd right(parts.layout.total(), (columns - rank + ranks - 1) / ranks);
  const auto whole = [&](int j) { return j % ranks == rank ? right.col(j / ranks).data() : nullptr; };
  for (int j = 0; j < columns; ++j)
    MPI_Gatherv(Y.entries.col(j).data(), rows, MPI_DOUBLE, whole(j), parts.layout.counts.data(),
                parts.layout.starts.data(), MPI_DOUBLE, j % ranks, parts.comm);
  parts.run_together(
      [&]
      {
        if (right.cols() > 0) right = solution_of(right);
      });
  for (int j = 0; j < columns; ++j)
    MPI_Scatterv(whole(j), parts.layout.counts.data(), parts.layout.starts.data(), MPI_DOUBLE, Y.entries.col(j).data(),
                 rows, MPI_DOUBLE, j % ranks, parts.comm);
  return Y;
}

} // namespace squeal
