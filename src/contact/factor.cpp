#include "squeal/contact/factor.hpp"

#include "squeal/contact/mumps.hpp"
#include "triplets.hpp"

#include <algorithm>
#include <cstring>
#include <dmumps_c.h>
#include <metis.h>
#include <petscblaslapack.h>
#include <string>

namespace squeal
{

namespace
{

/// MUMPS's ICNTL(26).
enum class Half
{
  both = 0,
  condense = 1,
  expand = 2,
};

} // namespace

/// `mumps` or `L`, by kind; the rest is of rank 0, except the layout.
struct Factor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  int dofs = 0, border = 0;
  bool failed = false;
  Shares shares;                              // of the degrees of freedom
  mutable std::vector<double> right, reduced; // columns: dofs (sparse: + border) and border long
  mutable int columns = 0;                    // of the last forward
  std::vector<double> corner;                 // -B A^-1 B' as MUMPS leaves it, or B A^-1 B'
  std::unique_ptr<DMUMPS_STRUC_C> mumps;      // all ranks
  std::vector<double> L, influence;           // dense, column-major: dofs x dofs, A^-1 B' of dofs x border

  bool here() const { return rank_of(comm) == 0; }
  int own() const { return shares.counts[static_cast<std::size_t>(rank_of(comm))]; }
  int length() const { return mumps ? dofs + border : dofs; } // of a column of `right`
  void solve_half(Half half) const;
  ~Parts();
};

namespace
{

/// Below this size dense algebra is quicker than MUMPS whatever the sparsity, and above it for a matrix this full:
/// tools/bench factors. A solve breaks even at 500 to 800, since MUMPS asks .1 ms for each; factoring at 400 on elastic
/// columns (17 % full at 300, 6 % at 1000), at 2 % on random patterns.
constexpr int dense_size = 500;
constexpr double dense_fill = 0.1;

void run(DMUMPS_STRUC_C& mumps, MumpsJob job)
{
  mumps.job = static_cast<MUMPS_INT>(job);
  dmumps_c(&mumps);
}

[[noreturn]] void give_up(const DMUMPS_STRUC_C& mumps, const char* phase)
{
  throw LibraryError("MUMPS " + std::string(phase) + ": INFOG(1) = " + std::to_string(mumps.infog[0]) +
                     ", INFOG(2) = " + std::to_string(mumps.infog[1]) + "; its manual lists them (-13: out of memory)");
}

/// Position of every unknown in the order of elimination, from one: METIS's nested dissection of A, then the border.
/// MUMPS was built without METIS here, and its own orderings fill more.
std::vector<MUMPS_INT> elimination_order(const Triplets& pattern, int dofs, int border)
{
  std::vector<idx_t> offsets(static_cast<std::size_t>(dofs) + 1, 0), neighbours;
  const auto off_diagonal = [&](std::size_t k)
  { return pattern.row[k] != pattern.column[k] && pattern.row[k] <= dofs; };
  const auto at = [](int number) { return static_cast<std::size_t>(number); };
  for (std::size_t k = 0; k < pattern.row.size(); ++k)
    if (off_diagonal(k)) ++offsets[at(pattern.row[k])], ++offsets[at(pattern.column[k])];
  for (std::size_t i = 0; i < at(dofs); ++i) offsets[i + 1] += offsets[i];
  neighbours.resize(at(offsets.back()) + 1); // never without an address
  std::vector<idx_t> next(offsets.begin(), offsets.end() - 1);
  for (std::size_t k = 0; k < pattern.row.size(); ++k)
  {
    if (!off_diagonal(k)) continue;
    const int i = pattern.row[k] - 1, j = pattern.column[k] - 1;
    neighbours[at(next[at(i)]++)] = j;
    neighbours[at(next[at(j)]++)] = i;
  }
  std::vector<idx_t> order(at(dofs)), position(at(dofs)), options(METIS_NOPTIONS);
  METIS_SetDefaultOptions(options.data());
  idx_t size = dofs;
  if (METIS_NodeND(&size, offsets.data(), neighbours.data(), nullptr, options.data(), order.data(), position.data()) !=
      METIS_OK)
    throw LibraryError("METIS found no elimination order");
  std::vector<MUMPS_INT> result(at(dofs + border));
  for (std::size_t i = 0; i < at(dofs); ++i) result[i] = position[i] + 1;
  for (std::size_t i = at(dofs); i < result.size(); ++i) result[i] = static_cast<MUMPS_INT>(i) + 1;
  return result;
}

std::unique_ptr<DMUMPS_STRUC_C> start_mumps(MPI_Comm comm)
{
  auto mumps = std::make_unique<DMUMPS_STRUC_C>();
  std::memset(mumps.get(), 0, sizeof(DMUMPS_STRUC_C));
  mumps->par = 1;
  mumps->sym = 2; // counts its negative pivots; with sym = 1 they would go unseen
  mumps->comm_fortran = static_cast<MUMPS_INT>(MPI_Comm_c2f(comm));
  run(*mumps, MumpsJob::start);
  for (const int stream : {1, 2, 3}) control(*mumps, stream) = -1;
  control(*mumps, 4) = 0;  // silent
  control(*mumps, 18) = 3; // every rank gives its share of the entries
  control(*mumps, 7) = 1;  // the order that is given
  control(*mumps, 14) = 1; // room beyond its estimate [%]: without pivoting that is near the truth
  mumps->cntl[0] = 0;      // no pivoting: positive definite
  return mumps;
}

/// Orders the elimination and foresees what it takes.
void analyse_by_mumps(DMUMPS_STRUC_C& mumps, Triplets& mine, int dofs, int border, MPI_Comm comm)
{
  std::vector<MUMPS_INT> order, kept;
  Triplets pattern = gathered(mine, Triplets::Part::pattern, comm);
  on_rank_zero(comm, [&] { order = elimination_order(pattern, dofs, border); });
  pattern = {};
  for (int i = 0; i < border; ++i) kept.push_back(dofs + i + 1);
  mumps.n = dofs + border;
  mumps.nnz_loc = static_cast<MUMPS_INT8>(mine.value.size());
  mumps.irn_loc = mine.row.data();
  mumps.jcn_loc = mine.column.data();
  mumps.a_loc = mine.value.data();
  mumps.perm_in = order.data();
  if (border > 0)
  {
    control(mumps, 19) = 1; // the corner whole on rank 0, by rows, of which the lower triangle is valid
    mumps.size_schur = border;
    mumps.listvar_schur = kept.data();
  }
  run(mumps, MumpsJob::analyse);
  if (mumps.infog[0] < 0) give_up(mumps, "analysis");
  mumps.perm_in = mumps.listvar_schur = nullptr;
}

/// False if a pivot was zero or negative. `schur`: room for the corner, on rank 0.
bool factorise_by_mumps(DMUMPS_STRUC_C& mumps, std::vector<double>& schur)
{
  mumps.schur = schur.data();
  factorise_in_room(mumps, [&] { run(mumps, MumpsJob::factorise); });
  mumps.irn_loc = mumps.jcn_loc = nullptr;
  mumps.a_loc = nullptr;
  if (mumps.infog[0] < 0 && mumps.infog[0] != -10) give_up(mumps, "factorisation");
  return mumps.infog[0] == 0 && mumps.infog[11] == 0;
}

/// B may be null.
int rows_of(Mat B)
{
  PetscInt rows = 0;
  if (B) check(MatGetSize(B, &rows, nullptr));
  return static_cast<int>(rows);
}

/// This rank's share of the lower triangle of A and of B below it.
Triplets bordered(Mat A, Mat B)
{
  Triplets mine = lower_triangle(A);
  if (B) append_rows(B, rows_of(A), mine);
  return mine;
}

Factor::Kind chosen(Factor::Kind kind, Mat A, const Triplets& mine)
{
  if (kind != Factor::Kind::automatic) return kind;
  double entries = static_cast<double>(mine.row.size()), size = rows_of(A);
  MPI_Allreduce(MPI_IN_PLACE, &entries, 1, MPI_DOUBLE, MPI_SUM, comm_of(A));
  return size <= dense_size || 2 * entries > dense_fill * size * size ? Factor::Kind::dense : Factor::Kind::sparse;
}

std::size_t area(int rows, int columns)
{
  return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
}

/// L, A^-1 B' and B A^-1 B' on rank 0; false if A is not positive definite.
bool factorise_dense(const Triplets& all, int dofs, int border, std::vector<double>& L, std::vector<double>& influence,
                     std::vector<double>& corner)
{
  L.assign(area(dofs, dofs), 0.);
  influence.assign(area(dofs, border), 0.);
  corner.assign(area(border, border), 0.);
  const auto place = [&](std::vector<double>& matrix, int i, int j) -> double&
  { return matrix[area(dofs, j) + static_cast<std::size_t>(i)]; };
  for (std::size_t k = 0; k < all.row.size(); ++k)
  {
    const int i = all.row[k] - 1, j = all.column[k] - 1;
    (i < dofs ? place(L, i, j) : place(influence, j, i - dofs)) += all.value[k];
  }
  PetscBLASInt n = dofs, m = border, info = 0;
  double one = 1, zero = 0;
  LAPACKpotrf_("L", &n, L.data(), &n, &info);
  if (info != 0) return false;
  if (m == 0) return true;
  BLAStrsm_("L", "L", "N", "N", &n, &m, &one, L.data(), &n, influence.data(), &n);
  // the upper triangle by columns is the lower one by rows
  BLASsyrk_("U", "T", &m, &n, &one, influence.data(), &n, &zero, corner.data(), &m);
  BLAStrsm_("L", "L", "T", "N", &n, &m, &one, L.data(), &n, influence.data(), &n);
  return true;
}

/// c = alpha op(A) b + beta c, for `count` columns.
void product(const char* op, const std::vector<double>& A, int rows, int columns, double alpha,
             const std::vector<double>& b, int count, double beta, std::vector<double>& c)
{
  const bool transposed = *op == 'T';
  PetscBLASInt m = transposed ? columns : rows, k = transposed ? rows : columns, n = count, leading = rows;
  BLASgemm_(op, "N", &m, &n, &k, &alpha, A.data(), &leading, b.data(), &k, &beta, c.data(), &m);
}

/// Lower triangle times `factor`, and its mirror image, by tiles that fit the cache.
void mirror(std::vector<double>& matrix, int size, double factor)
{
  const auto n = static_cast<std::size_t>(size);
  constexpr std::size_t tile = 64;
  for (std::size_t row = 0; row < n; row += tile)
    for (std::size_t column = 0; column <= row; column += tile)
      for (std::size_t i = row; i < std::min(row + tile, n); ++i)
        for (std::size_t j = column; j < std::min(column + tile, i + 1); ++j)
          matrix[j * n + i] = matrix[i * n + j] *= factor;
}

} // namespace

void Factor::Parts::solve_half(Half half) const
{
  control(*mumps, 26) = static_cast<MUMPS_INT>(half);
  control(*mumps, 27) = std::max(1, columns); // all of them at each reading of the factor
  mumps->rhs = right.data();
  mumps->nrhs = columns;
  mumps->lrhs = length();
  mumps->redrhs = reduced.data();
  mumps->lredrhs = border;
  run(*mumps, MumpsJob::solve_phase);
  if (mumps->infog[0] < 0) give_up(*mumps, "solution");
}

Factor::Parts::~Parts()
{
  if (mumps) run(*mumps, MumpsJob::end);
}

Factor::Factor() = default;
Factor::Factor(Factor&&) noexcept = default;
Factor& Factor::operator=(Factor&&) noexcept = default;
Factor::~Factor() = default;

Factor::Factor(Mat A, Mat B, Kind kind) : parts_(std::make_unique<Parts>())
{
  Parts& parts = *parts_;
  parts.comm = comm_of(A);
  parts.shares = shares_of(A);
  parts.dofs = parts.shares.total();
  parts.border = rows_of(B);
  Triplets mine = bordered(A, B);
  int good = 1;
  if (chosen(kind, A, mine) == Kind::sparse)
  {
    parts.mumps = start_mumps(parts.comm);
    analyse_by_mumps(*parts.mumps, mine, parts.dofs, parts.border, parts.comm);
    if (parts.here()) parts.corner.resize(area(parts.border, parts.border));
    good = factorise_by_mumps(*parts.mumps, parts.corner);
  }
  else
  {
    const Triplets all = gathered(mine, Triplets::Part::everything, parts.comm);
    if (parts.here()) good = factorise_dense(all, parts.dofs, parts.border, parts.L, parts.influence, parts.corner);
    MPI_Bcast(&good, 1, MPI_INT, 0, parts.comm);
  }
  parts.failed = !good;
}

bool Factor::failed() const
{
  return parts_->failed;
}

std::vector<double> Factor::condensed(double scale)
{
  if (parts_->here()) mirror(parts_->corner, parts_->border, parts_->mumps ? -scale : scale);
  return std::move(parts_->corner);
}

std::vector<double> Factor::forward(std::span<const Vec> b) const
{
  const Parts& parts = *parts_;
  parts.columns = static_cast<int>(b.size());
  const auto length = static_cast<std::size_t>(parts.length());
  if (parts.here()) parts.right.resize(length * b.size());
  for (std::size_t column = 0; column < b.size(); ++column)
  {
    const double* mine = nullptr;
    check(VecGetArrayRead(b[column], &mine));
    double* whole = parts.here() ? &parts.right[column * length] : nullptr;
    MPI_Gatherv(mine, parts.own(), MPI_DOUBLE, whole, parts.shares.counts.data(), parts.shares.starts.data(),
                MPI_DOUBLE, 0, parts.comm);
    check(VecRestoreArrayRead(b[column], &mine));
    if (whole) std::fill(whole + parts.dofs, whole + length, 0.);
  }
  if (parts.here()) parts.reduced.assign(area(parts.border, parts.columns), 0.);
  if (parts.border == 0) return {};
  if (parts.mumps)
  {
    parts.solve_half(Half::condense);
    for (double& value : parts.reduced) value = -value; // MUMPS leaves 0 - B A^-1 b
  }
  else if (parts.here())
    product("T", parts.influence, parts.dofs, parts.border, 1, parts.right, parts.columns, 0, parts.reduced);
  return parts.reduced;
}

void Factor::backward(const std::vector<double>& lambda, std::span<const Vec> x) const
{
  const Parts& parts = *parts_;
  if (parts.mumps)
  {
    if (parts.here()) parts.reduced = lambda;
    parts.solve_half(parts.border > 0 ? Half::expand : Half::both);
  }
  else if (parts.here())
  {
    PetscBLASInt n = parts.dofs, m = parts.columns, info = 0;
    LAPACKpotrs_("L", &n, &m, parts.L.data(), &n, parts.right.data(), &n, &info);
    if (parts.border > 0)
      product("N", parts.influence, parts.dofs, parts.border, -1, lambda, parts.columns, 1, parts.right);
  }
  const auto length = static_cast<std::size_t>(parts.length());
  for (std::size_t column = 0; column < x.size(); ++column)
  {
    double* mine = nullptr;
    check(VecGetArrayWrite(x[column], &mine));
    const double* whole = parts.here() ? &parts.right[column * length] : nullptr;
    MPI_Scatterv(whole, parts.shares.counts.data(), parts.shares.starts.data(), MPI_DOUBLE, mine, parts.own(),
                 MPI_DOUBLE, 0, parts.comm);
    check(VecRestoreArrayWrite(x[column], &mine));
  }
}

double Factor::entries() const
{
  const DMUMPS_STRUC_C* mumps = parts_->mumps.get();
  if (!mumps) return .5 * static_cast<double>(parts_->dofs) * parts_->dofs;
  const int told = mumps->infog[28]; // negative: in millions
  return told < 0 ? -1e6 * told : told;
}

double factor_memory(Mat A, Mat B)
{
  const int dofs = rows_of(A), border = rows_of(B);
  Triplets mine = bordered(A, B);
  if (chosen(Factor::Kind::automatic, A, mine) == Factor::Kind::dense)
    return 8 * static_cast<double>(area(dofs, dofs + border));
  const auto mumps = start_mumps(comm_of(A));
  analyse_by_mumps(*mumps, mine, dofs, border, comm_of(A));
  const double megabytes = mumps->infog[16];
  run(*mumps, MumpsJob::end);
  return 1e6 * megabytes;
}

void solve(const Factor& factor, Vec b, Vec x)
{
  const std::vector<double> nothing(factor.forward(std::span(&b, 1)).size(), 0.);
  factor.backward(nothing, std::span(&x, 1));
}

} // namespace squeal
