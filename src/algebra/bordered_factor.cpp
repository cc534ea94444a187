#include "squeal/algebra/bordered_factor.hpp"

#include "cholesky.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/free_memory.hpp"

#include <algorithm>
#include <optional>

namespace squeal
{

/// A's factor by MUMPS beside B.
struct MumpsBordered
{
  PencilFactor factor;
  Owned<Mat> B; // null: none
  bool regular = factor.factorise(0) && factor.negative_pivots() == 0;
  MultiVector x{}; // A^-1 b
};

struct Factor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  int border = 0;
  std::optional<Cholesky> cholesky{}; // else
  std::unique_ptr<MumpsBordered> mumps{};

  bool on_rank_zero() const { return rank_of(comm) == 0; }
};

namespace
{

/// B may be null.
int rows_of(Mat B)
{
  return B ? to_int(row_count(B)) : 0;
}

/// This rank's share of the lower triangle of A and of B below it.
Triplets bordered(Mat A, Mat B)
{
  Triplets entries = lower_triangle(A);
  if (B) append_rows(B, rows_of(A), entries);
  return entries;
}

/// B'F; F has a row for each of B, whole on every rank.
MultiVector transposed_product(Mat B, const Eigen::MatrixXd& F)
{
  const Owned<Vec> rows = vector_of_rows(B);
  std::vector<Owned<Vec>> images;
  for (Eigen::Index k = 0; k < F.cols(); ++k)
  {
    images.push_back(vector_of_columns(B));
    set_all_entries(rows, {F.col(k).data(), static_cast<std::size_t>(F.rows())});
    check(MatMultTranspose(B, rows, images.back()));
  }
  return columns_of(std::vector<Vec>(images.begin(), images.end()));
}

PencilFactor by_mumps(Mat A)
{
  constexpr PetscInt room = 1; // [%] without delayed pivots the estimate is close
  return PencilFactor(A, nullptr, Keep::factor, {room, 0, "factor_"});
}

/// The plan of a factor: its matrix, kind and order.
struct Plan
{
  FactorKind kind;         // not automatic
  Triplets entries;        // this rank's share
  SymbolicFactor symbolic; // on rank 0
  double memory = 0;       // of a supernodal factor [bytes]
};

Plan make_plan(Mat A, Mat B, const FactorOptions& options)
{
  const MPI_Comm comm = comm_of(A);
  Plan plan{options.kind, bordered(A, B), {}, 0};
  const Triplets pattern = gather({plan.entries.row, plan.entries.column, {}}, comm);
  plan.symbolic = analyse(pattern, rows_of(A), rows_of(B), comm, options.known.get());
  plan.memory = cholesky_memory(plan.symbolic);
  MPI_Bcast(&plan.memory, 1, MPI_DOUBLE, 0, comm);
  constexpr double gigabyte = 1e9;
  const bool too_large = ranks_of(comm) > 1 && plan.memory / ranks_of(comm) > options.share_limit() * gigabyte;
  if (options.kind == FactorKind::automatic) plan.kind = too_large ? FactorKind::mumps : FactorKind::supernodal;
  return plan;
}

/// Operations of a dense factor of some columns with rows below them.
double operations_of(double columns, double below)
{
  return columns * (columns * columns / 3 + columns * below + below * below);
}

/// Operations of all supernodes.
double operations_of(const SymbolicFactor& symbolic)
{
  double sum = 0;
  for (const Supernode& supernode : symbolic.supernodes) sum += operations_of(supernode.columns, supernode.below);
  return sum;
}

/// All but the bytes and the operations of all ranks. MUMPS keeps the square of a front's pivots, and waiting updates
/// and fronts are squares.
FactorForecast multifrontal_forecast(const SymbolicFactor& symbolic)
{
  FactorForecast forecast;
  double waiting = 0, symmetric = 0;
  const auto square = [](double x) { return x * x; };
  for (const Supernode& supernode : symbolic.supernodes)
  {
    const double columns = supernode.columns, inner = supernode.inner();
    const double front = square(columns + inner);
    forecast.symmetric = std::max(forecast.symmetric, symmetric + waiting + front);
    forecast.working = std::max(forecast.working, waiting + front);
    for (const int child : supernode.children)
      waiting -= square(symbolic.supernodes[static_cast<std::size_t>(child)].inner());
    waiting += square(inner);
    symmetric += columns * (columns + inner);
    forecast.entries += columns * ((columns + 1) / 2 + inner);
  }
  return forecast;
}

/// Multiplies the lower triangle, stored by columns, by `factor` and copies it to the upper one, by blocks that fit the
/// cache.
void scale_and_mirror(std::vector<double>& matrix, int size, double factor)
{
  const auto n = static_cast<std::size_t>(size);
  constexpr std::size_t block = 64;
  for (std::size_t row = 0; row < n; row += block)
    for (std::size_t column = 0; column <= row; column += block)
      for (std::size_t i = row; i < std::min(row + block, n); ++i)
        for (std::size_t j = column; j < std::min(column + block, i + 1); ++j)
          matrix[i * n + j] = matrix[j * n + i] *= factor;
}

/// The number of columns of a strip of moderate size that is wide enough for BLAS; see read().
std::size_t strip_width(std::size_t size)
{
  constexpr std::size_t least = 384, numbers = 2 << 20, together = 24; // 16 MB; whole pairs and whole tiles
  return std::max(least, numbers / std::max<std::size_t>(1, size) / together * together);
}

} // namespace

Factor::Factor() = default;
Factor::Factor(Factor&&) noexcept = default;
Factor& Factor::operator=(Factor&&) noexcept = default;
Factor::~Factor() = default;

Factor::Factor(Mat A, Mat B, const FactorOptions& options) : parts_(std::make_unique<Parts>())
{
  Parts& parts = *parts_;
  parts.comm = comm_of(A);
  parts.border = rows_of(B);
  Plan plan = make_plan(A, B, options);
  if (plan.kind == FactorKind::mumps)
    parts.mumps.reset(new MumpsBordered{by_mumps(A), B ? shared(B) : Owned<Mat>()});
  else
    parts.cholesky.emplace(std::move(plan.entries), std::move(plan.symbolic), row_layout(A), parts.comm);
}

bool Factor::failed() const
{
  return parts_->cholesky ? parts_->cholesky->failed() : !parts_->mumps->regular;
}

std::vector<double> Factor::condensed(double scale) const
{
  const auto n = static_cast<std::size_t>(parts_->on_rank_zero() ? parts_->border : 0);
  std::vector<double> result = vector_on_large_pages(n * n);
  result.resize(n * n);
  read_condensed(
      [&](const CondensedStrip& strip)
      {
        for (std::size_t j = strip.first; j < strip.last; ++j)
          std::copy_n(strip.values + (j - strip.first) * strip.height, strip.height, &result[j * n + strip.first]);
      });
  if (parts_->on_rank_zero()) scale_and_mirror(result, parts_->border, scale);
  return result;
}

void Factor::read_condensed(const std::function<void(const CondensedStrip&)>& take) const
{
  std::vector<std::size_t> firsts(static_cast<std::size_t>(ranks_of(parts_->comm)) + 1, at(parts_->border));
  firsts[0] = 0;
  read_condensed(take, firsts);
}

void Factor::read_condensed(const std::function<void(const CondensedStrip&)>& take,
                            std::span<const std::size_t> firsts) const
{
  const auto n = static_cast<std::size_t>(parts_->border);
  if (parts_->cholesky)
  {
    std::vector<Cholesky::WantedColumns> strips;
    for (std::size_t rank = 0; rank + 1 < firsts.size(); ++rank)
      for (std::size_t first = firsts[rank]; first < firsts[rank + 1]; first += strip_width(n))
        strips.push_back({first, std::min(first + strip_width(n), firsts[rank + 1]), to_int(rank)});
    // those of all ranks in turn: each takes its own while the others form theirs
    std::stable_sort(strips.begin(), strips.end(),
                     [&](const auto& a, const auto& b)
                     { return a.first - firsts[at(a.rank)] < b.first - firsts[at(b.rank)]; });
    return parts_->cholesky->read_schur_complement(strips, take);
  }
  constexpr std::size_t at_once = 96; // columns
  const Mat B = parts_->mumps->B;
  for (std::size_t rank = 0; rank + 1 < firsts.size(); ++rank)
    for (std::size_t first = firsts[rank], last = first; first < firsts[rank + 1]; first = last)
    {
      last = std::min(first + at_once, firsts[rank + 1]);
      Eigen::MatrixXd units = Eigen::MatrixXd::Zero(parts_->border, static_cast<Eigen::Index>(last - first));
      units.diagonal(-static_cast<Eigen::Index>(first)).setOnes();
      const Eigen::MatrixXd columns = whole_product(B, parts_->mumps->factor.solve(transposed_product(B, units))),
                            below = columns.bottomRows(static_cast<Eigen::Index>(n - first));
      if (to_int(rank) == rank_of(parts_->comm)) take({first, last, n - first, below.data()});
    }
}

std::vector<double> Factor::forward(std::span<const Vec> b) const
{
  if (parts_->mumps)
  {
    auto& [factor, B, regular, x] = *parts_->mumps;
    x = factor.solve(columns_of(b));
    if (!B) return {};
    const Eigen::MatrixXd seen = whole_product(B, x);
    return parts_->on_rank_zero() ? std::vector<double>(seen.data(), seen.data() + seen.size()) : std::vector<double>();
  }
  std::vector<const double*> own(b.size());
  for (std::size_t k = 0; k < b.size(); ++k) check(VecGetArrayRead(b[k], &own[k]));
  std::vector<double> result = parts_->cholesky->forward(own);
  for (std::size_t k = 0; k < b.size(); ++k) check(VecRestoreArrayRead(b[k], &own[k]));
  return result;
}

void Factor::backward(const std::vector<double>& lambda, std::span<const Vec> x) const
{
  if (parts_->mumps)
  {
    auto& [factor, B, regular, solution] = *parts_->mumps;
    std::vector<double> forces = lambda;
    if (B) broadcast(forces, parts_->comm);
    if (B)
      solution.entries -=
          factor.solve(transposed_product(B, Eigen::MatrixXd::Map(forces.data(), parts_->border, solution.columns())))
              .entries;
    for (std::size_t k = 0; k < x.size(); ++k) copy_column(solution, static_cast<Eigen::Index>(k), x[k]);
    return;
  }
  std::vector<double*> own(x.size());
  for (std::size_t k = 0; k < x.size(); ++k) check(VecGetArrayWrite(x[k], &own[k]));
  parts_->cholesky->backward(lambda, own);
  for (std::size_t k = 0; k < x.size(); ++k) check(VecRestoreArrayWrite(x[k], &own[k]));
}

double Factor::entries() const
{
  return parts_->cholesky ? parts_->cholesky->entries() : parts_->mumps->factor.entries();
}

std::shared_ptr<KnownAnalyses> no_analyses()
{
  return std::make_shared<KnownAnalyses>();
}

FactorForecast forecast_factor(Mat A, Mat B, const FactorOptions& options)
{
  const MPI_Comm comm = comm_of(A);
  Plan plan = make_plan(A, B, options);
  FactorForecast forecast = multifrontal_forecast(plan.symbolic);
  MPI_Bcast(&forecast, sizeof forecast, MPI_BYTE, 0, comm);
  forecast.kind = plan.kind;
  if (plan.kind == FactorKind::mumps)
  {
    forecast.operations = operations_of(plan.symbolic) / ranks_of(comm);
    MPI_Bcast(&forecast.operations, 1, MPI_DOUBLE, 0, comm);
    forecast.bytes = by_mumps(A).foreseen_memory();
  }
  else
  {
    const TreeShare share = share_tree(std::move(plan.symbolic), comm);
    forecast.bytes = cholesky_memory(share);
    forecast.operations = operations_of(share.symbolic);
    MPI_Allreduce(MPI_IN_PLACE, &forecast.bytes, 1, MPI_DOUBLE, MPI_SUM, comm);
    MPI_Allreduce(MPI_IN_PLACE, &forecast.operations, 1, MPI_DOUBLE, MPI_MAX, comm);
  }
  return forecast;
}

void solve(const Factor& factor, Vec b, Vec x)
{
  const std::vector<double> no_forces(factor.forward(std::span(&b, 1)).size(), 0.);
  factor.backward(no_forces, std::span(&x, 1));
}

} // namespace squeal
