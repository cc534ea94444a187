#include "squeal/algebra/pencil_factor.hpp"

#include "mumps.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "symbolic_factor.hpp"

#include <algorithm>
#include <numeric>
#include <petscsf.h>

/// A factor of moderate size is made whole by every rank, each of which solves its part of the right-hand sides. Shared
/// by ranks, MUMPS adds up in the order in which messages arrive: results would change in rounding from run to run, and
/// a restarted run would not give the straight run's numbers. A larger factor is shared, with the right-hand sides and
/// solutions where their rows are.

namespace squeal
{

struct PencilFactor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  RowLayout layout;
  std::vector<double> K, M; // entries at the places that either has, which MUMPS holds
  bool whole = false;       // whether every rank makes the whole factor
  Mumps mumps;

  /// Runs what communicates inside of MUMPS only if the ranks share one instance. Where each has its own, all agree on
  /// failures.
  template <class Work> void run_together(Work work) const { whole ? on_every_rank(comm, work) : work(); }
};

namespace
{

/// By the entries of a symmetric factor.
bool is_made_whole(double entries, const PencilOptions& options, MPI_Comm comm)
{
  return ranks_of(comm) > 1 && entries * sizeof(double) / 1e9 <= options.whole_limit;
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

/// K on the union of both patterns, and the values of M there. Both come by rows and rising columns.
std::pair<Triplets, std::vector<double>> on_common_pattern(const Triplets& K, const Triplets& M)
{
  const auto place = [](const Triplets& A, std::size_t k) { return std::pair(A.row[k], A.column[k]); };
  const std::size_t of_K = K.value.size(), of_M = M.value.size();
  std::pair<Triplets, std::vector<double>> both;
  auto& [entries, masses] = both;
  for (auto* places : {&entries.row, &entries.column}) places->reserve(std::max(of_K, of_M)); // mostly all of them
  for (auto* values : {&entries.value, &masses}) values->reserve(std::max(of_K, of_M));
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

/// Sends each row of a solution to its owner.
void bring_to_owners(const std::vector<MUMPS_INT>& places, const Eigen::MatrixXd& solution, const RowLayout& layout,
                     MPI_Comm comm, Eigen::MatrixXd& rows)
{
  std::vector<PetscSFNode> owners;
  for (const MUMPS_INT place : places)
  {
    const auto next = std::upper_bound(layout.starts.begin(), layout.starts.end(), to_int(place) - 1);
    owners.push_back(
        {static_cast<PetscInt>(next - layout.starts.begin() - 1), static_cast<PetscInt>(place - 1 - *(next - 1))});
  }
  Owned<PetscSF> exchange;
  check(PetscSFCreate(comm, exchange.put()));
  check(PetscSFSetGraph(exchange, static_cast<PetscInt>(rows.rows()), static_cast<PetscInt>(owners.size()), nullptr,
                        PETSC_COPY_VALUES, owners.data(), PETSC_COPY_VALUES));
  for (Eigen::Index j = 0; j < solution.cols(); ++j)
  {
    check(PetscSFReduceBegin(exchange, MPI_DOUBLE, solution.col(j).data(), rows.col(j).data(), MPI_REPLACE));
    check(PetscSFReduceEnd(exchange, MPI_DOUBLE, solution.col(j).data(), rows.col(j).data(), MPI_REPLACE));
  }
}

} // namespace

EliminationOrder elimination_order(Mat K)
{
  const Triplets pattern = gather(lower_triangle(K), TripletContent::pattern, comm_of(K));
  EliminationOrder order;
  const SymbolicFactor symbolic = analyse(pattern, row_layout(K).total(), 0, comm_of(K));
  for (const int position : symbolic.position) order.position.push_back(position + 1);
  order.entries = symbolic.entries;
  MPI_Bcast(&order.entries, 1, MPI_DOUBLE, 0, comm_of(K));
  broadcast(order.position, comm_of(K));
  return order;
}

PencilFactor::PencilFactor(Mat K, Mat M, Keep keep, const PencilOptions& options, const EliminationOrder* known)
    : parts_(std::make_unique<Parts>())
{
  Parts& parts = *parts_;
  parts.comm = comm_of(K);
  parts.layout = row_layout(K);
  const bool symmetric = keep != Keep::lu;
  const EliminationOrder made = known ? EliminationOrder{} : elimination_order(K), &order = known ? *known : made;
  std::vector<MUMPS_INT> positions(order.position.begin(), order.position.end());
  parts.whole = is_made_whole(order.entries, options, parts.comm);
  const auto entries_of = [&](Mat A)
  {
    Triplets own = symmetric ? lower_triangle(A) : Triplets{};
    if (!symmetric) append_rows(A, 0, own);
    return parts.whole ? everywhere(std::move(own), parts.comm) : own;
  };
  auto [entries, masses] = on_common_pattern(entries_of(K), M ? entries_of(M) : Triplets{});
  parts.M = std::move(masses);
  parts.mumps =
      start_mumps(parts.whole ? MPI_COMM_SELF : parts.comm, symmetric ? MumpsSymmetry::symmetric : MumpsSymmetry::none);
  set_entries(parts.mumps, entries, parts.layout.total());
  parts.K = std::move(entries.value); // MUMPS's pointer to them stays valid
  DMUMPS_STRUC_C& mumps = *parts.mumps;
  control(mumps, 14) = to_int(options.room);
  if (keep == Keep::count) control(mumps, 31) = 1; // the factor is discarded, front by front
  set_controls_from_options(mumps, options.prefix);
  mumps.perm_in = positions.data();
  parts.run_together([&] { run(mumps, MumpsJob::analyse); });
  mumps.perm_in = nullptr;
}

PencilFactor::~PencilFactor() = default;

double forecast_pencil(const FactorForecast& forecast, double entries_of_K, const PencilOptions& options, MPI_Comm comm)
{
  // the place, both entries, K - shift M, and that once more in MUMPS's order
  constexpr double an_entry = 2 * sizeof(int) + 3 * sizeof(double) + sizeof(double) + sizeof(MUMPS_INT);
  const double copies = is_made_whole(forecast.entries, options, comm) ? ranks_of(comm) : 1;
  return copies * (an_entry * entries_of_K / 2 + sizeof(double) * forecast.symmetric); // the lower half
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

double PencilFactor::entries() const
{
  const int number = information(*parts_->mumps, 29); // a negative one counts millions
  return number < 0 ? -1e6 * number : number;
}

double PencilFactor::foreseen_memory() const
{
  constexpr double megabyte = 1e6;
  return megabyte * (information(*parts_->mumps, 17) + 1); // it is rounded down
}

MultiVector PencilFactor::solve(const MultiVector& X) const
{
  Parts& parts = *parts_;
  MultiVector Y = X;
  if (X.columns() == 0) return Y;
  control(*parts.mumps, 27) = to_int(X.columns()); // all of them at each reading of the factor
  parts.whole || ranks_of(parts.comm) == 1 ? solve_by_columns(parts, Y) : solve_by_rows(parts, Y);
  return Y;
}

/// Each rank solves some of the columns, with its own factor.
void PencilFactor::solve_by_columns(Parts& parts, MultiVector& Y)
{
  const int rows = to_int(Y.entries.rows()), columns = to_int(Y.columns()), rank = rank_of(parts.comm),
            ranks = ranks_of(parts.comm);
  Eigen::MatrixXd right(parts.layout.total(), (columns - rank + ranks - 1) / ranks);
  const auto whole = [&](int j) { return j % ranks == rank ? right.col(j / ranks).data() : nullptr; };
  for (int j = 0; j < columns; ++j)
    MPI_Gatherv(Y.entries.col(j).data(), rows, MPI_DOUBLE, whole(j), parts.layout.counts.data(),
                parts.layout.starts.data(), MPI_DOUBLE, j % ranks, parts.comm);
  DMUMPS_STRUC_C& mumps = *parts.mumps;
  mumps.rhs = right.data();
  mumps.nrhs = to_int(right.cols());
  mumps.lrhs = parts.layout.total();
  parts.run_together(
      [&]
      {
        if (mumps.nrhs > 0) run(mumps, MumpsJob::solve);
      });
  for (int j = 0; j < columns; ++j)
    MPI_Scatterv(whole(j), parts.layout.counts.data(), parts.layout.starts.data(), MPI_DOUBLE, Y.entries.col(j).data(),
                 rows, MPI_DOUBLE, j % ranks, parts.comm);
}

/// All ranks solve all columns with the factor that they share. The solution comes in the rows that MUMPS chooses.
void PencilFactor::solve_by_rows(Parts& parts, MultiVector& Y)
{
  DMUMPS_STRUC_C& mumps = *parts.mumps;
  const int columns = to_int(Y.columns()), first = parts.layout.starts[static_cast<std::size_t>(rank_of(parts.comm))];
  std::vector<MUMPS_INT> own(static_cast<std::size_t>(Y.entries.rows()));
  std::iota(own.begin(), own.end(), first + 1);
  const int share = std::max<int>(1, mumps.info[22]); // INFO(23): rows of the solution that come to this rank
  std::vector<MUMPS_INT> places(static_cast<std::size_t>(share), 0);
  Eigen::MatrixXd solution(share, columns);
  control(mumps, 20) = 10; // right-hand sides by rows,
  control(mumps, 21) = 1;  // and solutions
  mumps.nrhs = columns;
  mumps.nloc_rhs = to_int(own.size());
  mumps.lrhs_loc = std::max<MUMPS_INT>(1, mumps.nloc_rhs);
  mumps.irhs_loc = own.data();
  mumps.rhs_loc = Y.entries.data();
  mumps.lsol_loc = share;
  mumps.isol_loc = places.data();
  mumps.sol_loc = solution.data();
  run(mumps, MumpsJob::solve);
  places.resize(static_cast<std::size_t>(mumps.info[22]));
  bring_to_owners(places, solution, parts.layout, parts.comm, Y.entries);
}

} // namespace squeal
