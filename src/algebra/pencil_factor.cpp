#include "squeal/algebra/pencil_factor.hpp"

#include "mumps.hpp"
#include "squeal/algebra/factor_forecast.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/integers.hpp"
#include "symbolic_factor.hpp"

/// A factor of moderate size is made whole by every rank, each of which solves its part of the right-hand sides. Shared
/// by ranks, MUMPS adds up in the order in which messages arrive: results would change in rounding from run to run, and
/// a restarted run would not give the straight run's numbers. A larger factor is shared.

namespace squeal
{

struct PencilFactor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  RowLayout layout;
  std::vector<double> K, M; // entries at the places that either has, which MUMPS holds
  Eigen::MatrixXd right;    // the columns that this rank's instance of MUMPS solves
  bool whole = false;       // whether every rank makes the whole factor
  Mumps mumps;

  /// The rank that solves a column.
  int solver_of(int column) const { return whole ? column % ranks_of(comm) : 0; }
  int column_stride() const { return whole ? ranks_of(comm) : 1; }

  /// Runs what communicates inside of MUMPS only if the ranks share one instance. Where each has its own, all agree on
  /// failures.
  template <class Work> void run_together(Work work) const { whole ? on_every_rank(comm, work) : work(); }
};

namespace
{

/// [MB] The largest factor that every rank makes whole: a few seconds of one core, and less than the brake's own
/// memory.
constexpr double largest_whole = 200;

/// By the entries of a symmetric factor.
bool is_made_whole(double entries, Symmetry symmetry, MPI_Comm comm)
{
  const double megabytes = (symmetry == Symmetry::symmetric ? 1 : 2) * entries * sizeof(double) / 1e6;
  return ranks_of(comm) > 1 && megabytes <= largest_whole;
}

struct Ordering
{
  std::vector<MUMPS_INT> position; // of each degree of freedom in nested dissection, counted from one as MUMPS does
  double entries = 0;              // of a symmetric factor
};

/// On rank 0, but for the entries.
Ordering elimination_order(Mat K, int dofs)
{
  const Triplets pattern = gather(lower_triangle(K), TripletContent::pattern, comm_of(K));
  Ordering order;
  on_rank_zero(comm_of(K),
               [&]
               {
                 const SymbolicFactor symbolic = analyse(pattern, dofs, 0);
                 for (const int position : symbolic.position) order.position.push_back(position + 1);
                 order.entries = symbolic.entries;
               });
  MPI_Bcast(&order.entries, 1, MPI_DOUBLE, 0, comm_of(K));
  return order;
}

/// The entries of all ranks on every rank.
Triplets everywhere(Triplets entries, MPI_Comm comm)
{
  Triplets all = gather(std::move(entries), TripletContent::values, comm);
  broadcast(all.row, comm);
  broadcast(all.column, comm);
  broadcast(all.value, comm);
  return all;
}

/// K with zeros where M alone has entries, and M's beside them. Both come by rows and rising columns.
std::pair<Triplets, std::vector<double>> side_by_side(const Triplets& K, const Triplets& M)
{
  const auto place = [](const Triplets& A, std::size_t k) { return std::pair(A.row[k], A.column[k]); };
  const std::size_t of_K = K.value.size(), of_M = M.value.size();
  std::pair<Triplets, std::vector<double>> both;
  auto& [entries, masses] = both;
  for (std::size_t i = 0, j = 0; i < of_K || j < of_M;)
  {
    const bool in_K = j == of_M || (i < of_K && place(K, i) <= place(M, j));
    const bool in_M = i == of_K || (j < of_M && place(M, j) <= place(K, i));
    const auto [row, column] = in_K ? place(K, i) : place(M, j);
    entries.row.push_back(row);
    entries.column.push_back(column);
    entries.value.push_back(in_K ? K.value[i++] : 0);
    masses.push_back(in_M ? M.value[j++] : 0);
  }
  return both;
}

} // namespace

PencilFactor::PencilFactor(Mat K, Mat M, Symmetry symmetry, const PencilOptions& options)
    : parts_(std::make_unique<Parts>())
{
  Parts& parts = *parts_;
  parts.comm = comm_of(K);
  parts.layout = row_layout(K);
  const bool symmetric = symmetry == Symmetry::symmetric;
  Ordering order = elimination_order(K, parts.layout.total());
  parts.whole = is_made_whole(order.entries, symmetry, parts.comm);
  if (parts.whole) broadcast(order.position, parts.comm);
  const auto entries_of = [&](Mat A)
  {
    Triplets own;
    symmetric ? append_lower_triangle(A, own) : append_rows(A, 0, own);
    return parts.whole ? everywhere(std::move(own), parts.comm) : own;
  };
  auto [entries, masses] = side_by_side(entries_of(K), entries_of(M));
  parts.M = std::move(masses);
  parts.mumps =
      start_mumps(parts.whole ? MPI_COMM_SELF : parts.comm, symmetric ? MumpsSymmetry::symmetric : MumpsSymmetry::none);
  set_entries(parts.mumps, entries, parts.layout.total());
  parts.K = std::move(entries.value);
  DMUMPS_STRUC_C& mumps = *parts.mumps;
  control(mumps, 14) = to_int(options.room);
  mumps.perm_in = order.position.data();
  parts.run_together([&] { run(mumps, MumpsJob::analyse); });
  mumps.perm_in = nullptr;
}

PencilFactor::~PencilFactor() = default;

double forecast_pencil(const FactorForecast& forecast, double entries_of_K, Symmetry symmetry, MPI_Comm comm)
{
  const bool symmetric = symmetry == Symmetry::symmetric;
  // the place, both entries, K - shift M, and that once more in MUMPS's order
  constexpr double an_entry = 2 * sizeof(int) + 3 * sizeof(double) + sizeof(double) + sizeof(MUMPS_INT);
  const double entries = (symmetric ? 0.5 : 1) * entries_of_K; // the lower half, or all
  const double numbers = symmetric ? forecast.symmetric : forecast.not_symmetric;
  const double copies = is_made_whole(forecast.entries, symmetry, comm) ? ranks_of(comm) : 1;
  return copies * (an_entry * entries + sizeof(double) * numbers);
}

bool PencilFactor::factorise(double shift)
{
  Parts& parts = *parts_;
  std::vector<double> values(parts.K.size());
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = parts.K[k] - shift * parts.M[k];
  parts.mumps->a_loc = values.data();
  bool regular = false;
  parts.run_together([&] { regular = squeal::factorise(*parts.mumps); });
  parts.mumps->a_loc = nullptr;
  return regular;
}

int PencilFactor::negative_pivots() const
{
  return number_of_negative_pivots(*parts_->mumps);
}

MultiVector PencilFactor::solve(const MultiVector& X) const
{
  constexpr MUMPS_INT as_it_is = 1;
  control(*parts_->mumps, 9) = as_it_is;
  return solve_with(*parts_, X);
}

MultiVector PencilFactor::solve_transposed(const MultiVector& X) const
{
  constexpr MUMPS_INT transposed = 0;
  control(*parts_->mumps, 9) = transposed;
  return solve_with(*parts_, X);
}

MultiVector PencilFactor::solve_with(Parts& parts, const MultiVector& X)
{
  MultiVector Y = X;
  const int rows = to_int(X.entries.rows()), columns = to_int(X.columns()), rank = rank_of(parts.comm);
  if (columns == 0) return Y;
  int own = 0;
  for (int j = 0; j < columns; ++j)
    if (parts.solver_of(j) == rank) ++own;
  parts.right.resize(parts.layout.total(), own);
  const auto whole = [&](int j)
  { return parts.solver_of(j) == rank ? parts.right.col(j / parts.column_stride()).data() : nullptr; };
  for (int j = 0; j < columns; ++j)
    MPI_Gatherv(X.entries.col(j).data(), rows, MPI_DOUBLE, whole(j), parts.layout.counts.data(),
                parts.layout.starts.data(), MPI_DOUBLE, parts.solver_of(j), parts.comm);
  DMUMPS_STRUC_C& mumps = *parts.mumps;
  control(mumps, 27) = columns; // all of them at each reading of the factor
  mumps.rhs = parts.right.data();
  mumps.nrhs = parts.whole ? own : columns;
  mumps.lrhs = parts.layout.total();
  parts.run_together(
      [&]
      {
        if (mumps.nrhs > 0) run(mumps, MumpsJob::solve);
      });
  for (int j = 0; j < columns; ++j)
    MPI_Scatterv(whole(j), parts.layout.counts.data(), parts.layout.starts.data(), MPI_DOUBLE, Y.entries.col(j).data(),
                 rows, MPI_DOUBLE, parts.solver_of(j), parts.comm);
  return Y;
}

OptionList options_of(PencilOptions& options)
{
  return {
      {"-modes_factor_room", &options.room, Range::any,
       "[%] of memory beyond what MUMPS estimates for a factor; it grows by itself"},
  };
}

} // namespace squeal
