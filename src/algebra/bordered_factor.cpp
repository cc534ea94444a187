#include "squeal/algebra/bordered_factor.hpp"

#include "cholesky.hpp"
#include "mumps_factor.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/free_memory.hpp"

#include <algorithm>
#include <optional>

namespace squeal
{

struct Factor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  int dofs = 0, border = 0;
  RowLayout layout;                   // of the degrees of freedom
  std::optional<Cholesky> cholesky{}; // takes and gives each rank's own rows; else
  std::optional<MumpsFactor> mumps{}; // through rank 0
  std::vector<double> right{};        // there: right-hand sides and then solutions, `dofs` long each

  bool on_rank_zero() const { return rank_of(comm) == 0; }
  int own_rows() const { return layout.counts[static_cast<std::size_t>(rank_of(comm))]; }
  double* column(std::size_t k) { return on_rank_zero() ? &right[k * static_cast<std::size_t>(dofs)] : nullptr; }
};

namespace
{

/// B may be null.
int rows_of(Mat B)
{
  PetscInt rows = 0;
  if (B) check(MatGetSize(B, &rows, nullptr));
  return to_int(rows);
}

/// This rank's share of the lower triangle of A and of B below it.
Triplets bordered(Mat A, Mat B)
{
  Triplets entries = lower_triangle(A);
  if (B) append_rows(B, rows_of(A), entries);
  return entries;
}

/// What will be factored, how and in which order.
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
  Triplets pattern;
  if (ranks_of(comm) > 1) pattern = gather(plan.entries, TripletContent::pattern, comm);
  const Triplets& all = ranks_of(comm) > 1 ? pattern : plan.entries;
  plan.symbolic = options.known ? options.known->analyse(all, rows_of(A), rows_of(B), comm)
                                : analyse(all, rows_of(A), rows_of(B), comm);
  plan.memory = cholesky_memory(plan.symbolic);
  MPI_Bcast(&plan.memory, 1, MPI_DOUBLE, 0, comm);
  constexpr double gigabyte = 1e9;
  const bool too_large = ranks_of(comm) > 1 && plan.memory / ranks_of(comm) > options.share_limit() * gigabyte;
  if (options.kind == FactorKind::automatic) plan.kind = too_large ? FactorKind::mumps : FactorKind::supernodal;
  return plan;
}

/// Of a dense factor of n columns with so many rows below them.
double operations_of(double columns, double below)
{
  return columns * (columns * columns / 3 + columns * below + below * below);
}

/// Of the supernodes, and of a rank's share of them.
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
    for (const int child : supernode.children)
      waiting -= square(symbolic.supernodes[static_cast<std::size_t>(child)].inner());
    waiting += square(inner);
    symmetric += columns * (columns + inner);
    forecast.entries += columns * ((columns + 1) / 2 + inner);
    forecast.border_entries += columns * supernode.border;
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
  constexpr std::size_t least = 384, numbers = 2 << 20, together = CondensedProducts::together; // 16 MB
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
  parts.layout = row_layout(A);
  parts.dofs = parts.layout.total();
  parts.border = rows_of(B);
  Plan plan = make_plan(A, B, options);
  if (plan.kind == FactorKind::mumps)
    parts.mumps.emplace(
        BorderedEntries{std::move(plan.entries), plan.symbolic.position, parts.dofs, parts.border, parts.comm});
  else
    parts.cholesky.emplace(std::move(plan.entries), std::move(plan.symbolic), parts.layout, parts.comm);
}

bool Factor::failed() const
{
  return parts_->cholesky ? parts_->cholesky->failed() : parts_->mumps->failed();
}

std::vector<double> Factor::condensed(double scale) const
{
  std::vector<double> result;
  if (const auto products = condensed_products())
  {
    const auto n = static_cast<std::size_t>(parts_->on_rank_zero() ? parts_->border : 0);
    result = vector_on_large_pages(n * n);
    result.resize(n * n);
    products->read(
        [&](const CondensedStrip& strip)
        {
          for (std::size_t j = strip.first; j < strip.last; ++j)
            std::copy_n(strip.values + (j - strip.first) * strip.height, strip.height, &result[j * n + strip.first]);
        });
  }
  else
    result = parts_->mumps->take_schur_complement();
  if (parts_->on_rank_zero()) scale_and_mirror(result, parts_->border, scale);
  return result;
}

std::optional<CondensedProducts> Factor::condensed_products() const
{
  if (parts_->cholesky) return CondensedProducts(*parts_);
  return {};
}

int CondensedProducts::size() const
{
  return parts_->border;
}

double CondensedProducts::entries() const
{
  return parts_->cholesky->border_entries();
}

std::vector<double> CondensedProducts::product(std::span<const double> x) const
{
  return parts_->cholesky->schur_product(x);
}

void CondensedProducts::read(const std::function<void(const CondensedStrip&)>& take,
                             std::span<const std::size_t> shares) const
{
  const auto n = static_cast<std::size_t>(size());
  const std::array<std::size_t, 2> of_rank_zero{0, n};
  if (shares.empty()) shares = of_rank_zero;
  std::vector<Cholesky::WantedColumns> strips;
  for (std::size_t rank = 0; rank + 1 < shares.size(); ++rank)
    for (std::size_t first = shares[rank]; first < shares[rank + 1]; first += strip_width(n))
      strips.push_back({first, std::min(first + strip_width(n), shares[rank + 1]), to_int(rank)});
  // those of all ranks in turn: each takes its own while the others form theirs
  std::stable_sort(strips.begin(), strips.end(),
                   [&](const auto& a, const auto& b)
                   { return a.first - shares[at(a.rank)] < b.first - shares[at(b.rank)]; });
  parts_->cholesky->read_schur_complement(strips, take);
}

std::vector<double> Factor::forward(std::span<const Vec> b) const
{
  Parts& parts = *parts_;
  std::vector<const double*> own(b.size());
  for (std::size_t k = 0; k < b.size(); ++k) check(VecGetArrayRead(b[k], &own[k]));
  std::vector<double> result;
  if (parts.cholesky)
    result = parts.cholesky->forward(own);
  else
  {
    if (parts.on_rank_zero()) parts.right.resize(b.size() * static_cast<std::size_t>(parts.dofs));
    for (std::size_t k = 0; k < b.size(); ++k)
      MPI_Gatherv(own[k], parts.own_rows(), MPI_DOUBLE, parts.column(k), parts.layout.counts.data(),
                  parts.layout.starts.data(), MPI_DOUBLE, 0, parts.comm);
    result = parts.mumps->forward(parts.right, to_int(b.size()));
  }
  for (std::size_t k = 0; k < b.size(); ++k) check(VecRestoreArrayRead(b[k], &own[k]));
  return result;
}

void Factor::backward(const std::vector<double>& lambda, std::span<const Vec> x) const
{
  Parts& parts = *parts_;
  std::vector<double*> own(x.size());
  for (std::size_t k = 0; k < x.size(); ++k) check(VecGetArrayWrite(x[k], &own[k]));
  if (parts.cholesky)
    parts.cholesky->backward(lambda, own);
  else
  {
    parts.mumps->backward(lambda, parts.right);
    for (std::size_t k = 0; k < x.size(); ++k)
      MPI_Scatterv(parts.column(k), parts.layout.counts.data(), parts.layout.starts.data(), MPI_DOUBLE, own[k],
                   parts.own_rows(), MPI_DOUBLE, 0, parts.comm);
  }
  for (std::size_t k = 0; k < x.size(); ++k) check(VecRestoreArrayWrite(x[k], &own[k]));
}

double Factor::entries() const
{
  return parts_->cholesky ? parts_->cholesky->entries() : parts_->mumps->entries();
}

std::shared_ptr<KnownAnalyses> no_analyses()
{
  return std::make_shared<KnownAnalyses>();
}

FactorForecast forecast_factor(Mat A, Mat B, const FactorOptions& options)
{
  const int dofs = rows_of(A), border = rows_of(B);
  const MPI_Comm comm = comm_of(A);
  Plan plan = make_plan(A, B, options);
  FactorForecast forecast = multifrontal_forecast(plan.symbolic);
  MPI_Bcast(&forecast, sizeof forecast, MPI_BYTE, 0, comm);
  forecast.kind = plan.kind;
  if (plan.kind == FactorKind::mumps)
  {
    forecast.border_entries = 0;
    forecast.operations = operations_of(plan.symbolic) / ranks_of(comm);
    MPI_Bcast(&forecast.operations, 1, MPI_DOUBLE, 0, comm);
    forecast.bytes = mumps_factor_memory({std::move(plan.entries), plan.symbolic.position, dofs, border, comm});
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
