/// MUMPS (Amestoy, Duff, L'Excellent, Koster 2001) in a given order of elimination, from entries that are distributed.
/// Every call is collective of its ranks. Its INFOG is the same on all of them, so that errors are thrown together.
///
/// A factor of moderate size is made whole by every rank, each of which solves its part of the right-hand sides. Shared
/// by ranks, MUMPS adds up in the order in which messages arrive. Rounding would then differ from run to run, and
/// between a restarted run and a straight one. A larger factor is shared, with the right-hand sides and solutions on
/// rank 0.
#include "squeal/algebra/shift_invert.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/checkpoint.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/free_memory.hpp"
#include "symbolic_factor.hpp"

#include <algorithm>
#include <dmumps_c.h>
#include <iterator>
#include <string>

namespace squeal
{

namespace
{

/// JOB
enum class Job : MUMPS_INT
{
  start = -1,
  end = -2,
  analyse = 1,
  factorise = 2,
  solve = 3,
};

/// ICNTL(number), counted from one as in MUMPS's manual.
MUMPS_INT& control(DMUMPS_STRUC_C& mumps, int number)
{
  return mumps.icntl[number - 1];
}

/// INFOG(number), counted from one as in MUMPS's manual.
MUMPS_INT information(const DMUMPS_STRUC_C& mumps, int number)
{
  return mumps.infog[number - 1];
}

/// INFOG(1) after the job.
int outcome_of(DMUMPS_STRUC_C& mumps, Job job)
{
  mumps.job = static_cast<MUMPS_INT>(job);
  dmumps_c(&mumps);
  return information(mumps, 1);
}

[[noreturn]] void throw_failure(const DMUMPS_STRUC_C& mumps)
{
  constexpr int out_of_memory = -13;
  if (information(mumps, 1) == out_of_memory) throw LibraryError(out_of_memory_text);
  throw LibraryError("MUMPS, job " + std::to_string(mumps.job) +
                     ": INFOG(1) = " + std::to_string(information(mumps, 1)) +
                     ", INFOG(2) = " + std::to_string(information(mumps, 2)) + "; its manual lists them");
}

void run(DMUMPS_STRUC_C& mumps, Job job)
{
  if (outcome_of(mumps, job) < 0) throw_failure(mumps);
}

/// Factorises, and again with more memory beyond MUMPS's estimate, ICNTL(14), where delayed pivots or messages between
/// ranks took more. Returns false if the matrix is singular.
bool make_factor(DMUMPS_STRUC_C& mumps)
{
  constexpr int singular = -10, largest_increase = 2000; // [%]
  const auto exceeds_estimate = [](int outcome)
  { return outcome == -8 || outcome == -9 || outcome == -17 || outcome == -20; };
  int outcome = outcome_of(mumps, Job::factorise);
  for (MUMPS_INT& increase = control(mumps, 14); exceeds_estimate(outcome) && increase < largest_increase;
       outcome = outcome_of(mumps, Job::factorise))
    increase = 4 * std::max<MUMPS_INT>(increase, 0) + 10;
  if (outcome < 0 && outcome != singular) throw_failure(mumps);
  return outcome != singular;
}

/// Sets the controls that the options -<prefix>mat_mumps_icntl_N and -<prefix>mat_mumps_cntl_N give. Those of the
/// matrix's format, of the counted pivots and of single solves are the program's own and not asked for.
void set_controls_from_options(DMUMPS_STRUC_C& mumps, const char* prefix)
{
  constexpr std::array own = {5, 9, 13, 18, 19, 20, 21, 26, 27};
  for (int number = 1; number <= static_cast<int>(std::size(mumps.icntl)); ++number)
  {
    if (std::ranges::find(own, number) != own.end()) continue;
    auto value = static_cast<PetscInt>(control(mumps, number));
    check(PetscOptionsGetInt(nullptr, prefix, format("-mat_mumps_icntl_%d", number).c_str(), &value, nullptr));
    control(mumps, number) = static_cast<MUMPS_INT>(value);
  }
  for (std::size_t number = 1; number <= std::size(mumps.cntl); ++number)
    check(PetscOptionsGetReal(nullptr, prefix, format("-mat_mumps_cntl_%zu", number).c_str(), &mumps.cntl[number - 1],
                              nullptr));
}

} // namespace

struct PencilFactor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  RowLayout layout;
  std::vector<MUMPS_INT> row{}, column{};
  std::vector<double> K{}, M{}; // entries at the places that either has
  bool whole = false;           // whether every rank makes the whole factor
  bool started = false;
  DMUMPS_STRUC_C mumps{};

  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;
  explicit Parts(Mat A) : comm(comm_of(A)), layout(row_layout(A)) {}
  ~Parts()
  {
    if (started) outcome_of(mumps, Job::end);
    return_freed_memory();
  }

  /// Begins an instance without output. SYM = 1, for positive definite matrices, is not used: it counts no negative
  /// pivots.
  void begin(bool symmetric)
  {
    mumps.par = 1;
    mumps.sym = symmetric ? 2 : 0;
    mumps.comm_fortran = static_cast<MUMPS_INT>(MPI_Comm_c2f(whole ? MPI_COMM_SELF : comm));
    run(mumps, Job::start);
    started = true;
    for (const int stream : {1, 2, 3}) control(mumps, stream) = -1;
    control(mumps, 4) = 0;  // no output
    control(mumps, 7) = 1;  // the order of elimination is given
    control(mumps, 13) = 1; // no ScaLAPACK, since negative pivots of a root that it factors are not counted
    control(mumps, 18) = 3; // every rank gives its share of the entries
    mumps.n = layout.total();
    mumps.nnz_loc = static_cast<MUMPS_INT8>(K.size());
    mumps.irn_loc = row.data();
    mumps.jcn_loc = column.data();
    mumps.a_loc = K.data();
  }

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

/// Whether a factor of so many bytes is kept in files. Beside it there are matrices and as many vectors again.
/// Collective.
bool exceeds_memory(double bytes, MPI_Comm comm)
{
  constexpr double share = 0.4; // of what is free
  return bytes > share * free_memory(comm);
}

/// Keeps the factor in files, which end with the instance.
void use_files(DMUMPS_STRUC_C& mumps)
{
  const std::filesystem::path& folder = checkpoint_folder();
  control(mumps, 22) = 1;
  if (folder.empty() || folder.native().size() >= sizeof mumps.ooc_tmpdir) return; // then in MUMPS's own place
  std::filesystem::create_directories(folder);
  std::copy_n(folder.c_str(), folder.native().size() + 1, mumps.ooc_tmpdir);
}

/// The entries of all ranks on every rank.
Triplets everywhere(Triplets entries, MPI_Comm comm)
{
  Triplets all = gather(std::move(entries), comm);
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

} // namespace

EliminationOrder elimination_order(Mat K)
{
  Triplets pattern = lower_triangle(K);
  pattern.value.clear();
  pattern = gather(std::move(pattern), comm_of(K));
  EliminationOrder order;
  const SymbolicFactor symbolic = analyse(pattern, row_layout(K).total(), 0, comm_of(K));
  for (const int position : symbolic.position) order.position.push_back(position + 1);
  order.entries = symbolic.entries;
  MPI_Bcast(&order.entries, 1, MPI_DOUBLE, 0, comm_of(K));
  broadcast(order.position, comm_of(K));
  return order;
}

PencilFactor::PencilFactor(Mat K, Mat M, Keep keep, const PencilOptions& options, const EliminationOrder* known)
    : parts_(std::make_unique<Parts>(K))
{
  Parts& parts = *parts_;
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
  parts.row.assign(entries.row.begin(), entries.row.end());
  parts.column.assign(entries.column.begin(), entries.column.end());
  parts.K = std::move(entries.value);
  parts.M = std::move(masses);
  parts.begin(symmetric);
  DMUMPS_STRUC_C& mumps = parts.mumps;
  control(mumps, 14) = to_int(options.room);
  if (keep == Keep::count) control(mumps, 31) = 1; // the factor is discarded, front by front
  set_controls_from_options(mumps, options.prefix);
  mumps.perm_in = positions.data();
  parts.run_together([&] { run(mumps, Job::analyse); });
  mumps.perm_in = nullptr;
  const bool kept = keep != Keep::count && M; // without M it is a step's, which is read too often for files
  if (control(mumps, 22) == 1 || (kept && exceeds_memory(foreseen_memory(), parts.comm)))
    on_every_rank(parts.comm, [&] { use_files(mumps); });
}

PencilFactor::~PencilFactor() = default;

double forecast_pencil(const FactorForecast& forecast, double entries_of_K, Keep keep, const PencilOptions& options,
                       MPI_Comm comm)
{
  // the place, both entries, K - shift M, and that once more in MUMPS's order
  constexpr double an_entry = 2 * sizeof(int) + 3 * sizeof(double) + sizeof(double) + sizeof(MUMPS_INT);
  const double copies = is_made_whole(forecast.entries, options, comm) ? ranks_of(comm) : 1,
               halves = keep == Keep::lu ? 2 : 1, kept = halves * forecast.symmetric * sizeof(double);
  const bool in_files = keep == Keep::count || exceeds_memory(kept, comm);
  return copies * (halves * an_entry * entries_of_K / 2 + (in_files ? forecast.working * sizeof(double) : kept));
}

bool PencilFactor::factorise(double shift)
{
  Parts& parts = *parts_;
  std::vector<double> values(parts.K.size());
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = parts.K[k] - shift * parts.M[k];
  parts.mumps.a_loc = values.data();
  bool regular = false;
  parts.run_together([&] { regular = make_factor(parts.mumps); });
  parts.mumps.a_loc = nullptr;
  return regular;
}

int PencilFactor::negative_pivots() const
{
  return information(parts_->mumps, 12);
}

double PencilFactor::entries() const
{
  const int number = information(parts_->mumps, 29); // a negative one counts millions
  return number < 0 ? -1e6 * number : number;
}

double PencilFactor::foreseen_memory() const
{
  constexpr double megabyte = 1e6;
  return megabyte * (information(parts_->mumps, 17) + 1); // it is rounded down
}

MultiVector PencilFactor::solve(const MultiVector& X) const
{
  Parts& parts = *parts_;
  MultiVector Y = X;
  if (X.columns() == 0) return Y;
  const int rows = to_int(Y.entries.rows()), columns = to_int(Y.columns()), rank = rank_of(parts.comm);
  const int solvers = parts.whole ? ranks_of(parts.comm) : 1; // ranks that have right-hand sides, one after the other
  const int taken = rank < solvers ? (columns - rank + solvers - 1) / solvers : 0;
  Eigen::MatrixXd right(parts.layout.total(), taken);
  const auto whole = [&](int j) { return j % solvers == rank ? right.col(j / solvers).data() : nullptr; };
  for (int j = 0; j < columns; ++j)
    MPI_Gatherv(Y.entries.col(j).data(), rows, MPI_DOUBLE, whole(j), parts.layout.counts.data(),
                parts.layout.starts.data(), MPI_DOUBLE, j % solvers, parts.comm);
  DMUMPS_STRUC_C& mumps = parts.mumps;
  mumps.rhs = right.data();
  mumps.nrhs = parts.whole ? taken : columns;
  mumps.lrhs = parts.layout.total();
  control(mumps, 27) = columns; // all of them at each reading of the factor
  parts.run_together(
      [&]
      {
        if (mumps.nrhs > 0) run(mumps, Job::solve);
      });
  for (int j = 0; j < columns; ++j)
    MPI_Scatterv(whole(j), parts.layout.counts.data(), parts.layout.starts.data(), MPI_DOUBLE, Y.entries.col(j).data(),
                 rows, MPI_DOUBLE, j % solvers, parts.comm);
  return Y;
}

} // namespace squeal
