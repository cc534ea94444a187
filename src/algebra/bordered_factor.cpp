#include "squeal/algebra/bordered_factor.hpp"

#include "cholesky.hpp"
#include "distributed.hpp"

#include <algorithm>
#include <array>
#include <Eigen/Cholesky>
#include <optional>

namespace squeal
{

using Eigen::MatrixXd;

/// `cholesky`, `distributed` or `L`, by kind; all but `distributed` and the layout on rank 0.
struct Factor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  int dofs = 0, border = 0;
  bool failed = false;
  Shares shares;                     // of the degrees of freedom
  mutable std::vector<double> right; // columns of degrees of freedom
  mutable int columns = 0;           // of the last forward
  std::vector<double> corner;        // B A^-1 B', lower triangle by columns
  mutable std::optional<Cholesky> cholesky;
  mutable std::optional<Distributed> distributed; // on all ranks
  MatrixXd L, influence;                          // dense: the factor and A^-1 B'

  bool here() const { return rank_of(comm) == 0; }
  int own() const { return shares.counts[static_cast<std::size_t>(rank_of(comm))]; }
};

namespace
{

/// Below this size dense algebra is quicker whatever the sparsity, and above it for a matrix this full:
/// tools/bench factors.
constexpr int dense_size = 500;
constexpr double dense_fill = 0.1;

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

/// Whether algebra is quickest without a thought of zeros.
bool better_dense(Mat A, const Triplets& mine)
{
  double entries = static_cast<double>(mine.row.size()), size = rows_of(A);
  MPI_Allreduce(MPI_IN_PLACE, &entries, 1, MPI_DOUBLE, MPI_SUM, comm_of(A));
  return size <= dense_size || 2 * entries > dense_fill * size * size;
}

struct Choice
{
  Factor::Kind kind = Factor::Kind::automatic;
  /// [GB] that rank 0 may hold for all. Two ranks step an elastic block by MUMPS in 1.2 times the time, where it holds
  /// .06 as where it holds .28, the largest that was timed: tools/bench_step with -factor.
  double limit = .3;
};

/// A kind that is asked for in the program goes before the option.
Choice choice_of(Factor::Kind kind)
{
  Choice choice;
  const std::array<const char*, 4> kinds = {"automatic", "supernodal", "mumps", "dense"}; // in the order of Kind
  PetscInt option = 0;
  check(PetscOptionsGetEList(nullptr, nullptr, "-factor", kinds.data(), 4, &option, nullptr));
  check(PetscOptionsGetReal(nullptr, nullptr, "-factor_limit", &choice.limit, nullptr));
  choice.kind = kind == Factor::Kind::automatic ? static_cast<Factor::Kind>(option) : kind;
  return choice;
}

/// What will be factored, how and in which order.
struct Plan
{
  Factor::Kind kind; // one of them, not automatic
  Triplets entries;  // on rank 0; without values for MUMPS, which every rank gives its share
  Elimination order; // on rank 0, but for dense
  double memory = 0; // of a supernodal factor [bytes]
};

Plan planned(Factor::Kind asked, Mat A, Mat B)
{
  const MPI_Comm comm = comm_of(A);
  auto [kind, limit] = choice_of(asked);
  Triplets mine = bordered(A, B);
  if (kind == Factor::Kind::automatic && better_dense(A, mine)) kind = Factor::Kind::dense;
  const auto part = kind == Factor::Kind::mumps ? Triplets::Part::pattern : Triplets::Part::everything;
  Plan plan{kind, gathered(std::move(mine), part, comm), {}, 0};
  if (kind == Factor::Kind::dense) return plan;
  on_rank_zero(comm,
               [&]
               {
                 plan.order = eliminate(plan.entries, rows_of(A), rows_of(B));
                 plan.memory = cholesky_memory(plan.order);
               });
  MPI_Bcast(&plan.memory, 1, MPI_DOUBLE, 0, comm);
  const bool too_large = ranks_of(comm) > 1 && plan.memory > 1e9 * limit;
  if (kind == Factor::Kind::automatic) plan.kind = too_large ? Factor::Kind::mumps : Factor::Kind::supernodal;
  return plan;
}

std::size_t area(int rows, int columns)
{
  return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
}

/// On rank 0: A = L L', the influence A^-1 B' and the Schur complement B A^-1 B'. False if A is not positive definite.
bool factorise_dense(const Triplets& all, int dofs, int border, MatrixXd& L, MatrixXd& influence,
                     std::vector<double>& corner)
{
  L.setZero(dofs, dofs);
  influence.setZero(dofs, border);
  corner.assign(area(border, border), 0.);
  for (std::size_t k = 0; k < all.row.size(); ++k)
  {
    const int i = all.row[k] - 1, j = all.column[k] - 1;
    (i < dofs ? L(i, j) : influence(j, i - dofs)) += all.value[k];
  }
  if (Eigen::LLT<Eigen::Ref<MatrixXd>>(L).info() != Eigen::Success) return false;
  L.triangularView<Eigen::Lower>().solveInPlace(influence);
  MatrixXd::Map(corner.data(), border, border).selfadjointView<Eigen::Lower>().rankUpdate(influence.transpose());
  L.transpose().triangularView<Eigen::Upper>().solveInPlace(influence);
  return true;
}

/// Lower triangle by columns times `factor`, and its mirror image, by tiles that fit the cache.
void mirror(std::vector<double>& matrix, int size, double factor)
{
  const auto n = static_cast<std::size_t>(size);
  constexpr std::size_t tile = 64;
  for (std::size_t row = 0; row < n; row += tile)
    for (std::size_t column = 0; column <= row; column += tile)
      for (std::size_t i = row; i < std::min(row + tile, n); ++i)
        for (std::size_t j = column; j < std::min(column + tile, i + 1); ++j)
          matrix[i * n + j] = matrix[j * n + i] *= factor;
}

} // namespace

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
  Plan plan = planned(kind, A, B);
  if (plan.kind == Kind::mumps)
  {
    plan.entries = {};
    parts.distributed.emplace(bordered(A, B), plan.order.position, parts.dofs, parts.border, parts.comm);
    parts.failed = parts.distributed->failed();
    parts.corner = parts.distributed->take_corner();
    return;
  }
  int good = 1;
  on_rank_zero(parts.comm,
               [&]
               {
                 if (plan.kind == Kind::supernodal)
                 {
                   parts.cholesky.emplace(std::move(plan.entries), std::move(plan.order));
                   good = !parts.cholesky->failed();
                   parts.corner = parts.cholesky->take_corner();
                 }
                 else
                   good =
                       factorise_dense(plan.entries, parts.dofs, parts.border, parts.L, parts.influence, parts.corner);
               });
  MPI_Bcast(&good, 1, MPI_INT, 0, parts.comm);
  parts.failed = !good;
}

bool Factor::failed() const
{
  return parts_->failed;
}

std::vector<double> Factor::condensed(double scale)
{
  if (parts_->here()) mirror(parts_->corner, parts_->border, scale);
  return std::move(parts_->corner);
}

std::vector<double> Factor::forward(std::span<const Vec> b) const
{
  const Parts& parts = *parts_;
  parts.columns = static_cast<int>(b.size());
  if (parts.here()) parts.right.resize(area(parts.dofs, parts.columns));
  for (std::size_t column = 0; column < b.size(); ++column)
  {
    const double* mine = nullptr;
    check(VecGetArrayRead(b[column], &mine));
    double* whole = parts.here() ? &parts.right[area(parts.dofs, static_cast<int>(column))] : nullptr;
    MPI_Gatherv(mine, parts.own(), MPI_DOUBLE, whole, parts.shares.counts.data(), parts.shares.starts.data(),
                MPI_DOUBLE, 0, parts.comm);
    check(VecRestoreArrayRead(b[column], &mine));
  }
  if (parts.distributed) return parts.distributed->forward(parts.right, parts.columns);
  if (!parts.here()) return {};
  if (parts.cholesky) return parts.cholesky->forward(parts.right, parts.columns);
  std::vector<double> reduced(area(parts.border, parts.columns));
  MatrixXd::Map(reduced.data(), parts.border, parts.columns).noalias() =
      parts.influence.transpose() * MatrixXd::Map(parts.right.data(), parts.dofs, parts.columns);
  return reduced;
}

void Factor::backward(const std::vector<double>& lambda, std::span<const Vec> x) const
{
  const Parts& parts = *parts_;
  if (parts.distributed)
    parts.distributed->backward(lambda, parts.right);
  else if (parts.here() && parts.cholesky)
    parts.cholesky->backward(lambda, parts.right);
  else if (parts.here())
  {
    auto right = MatrixXd::Map(parts.right.data(), parts.dofs, parts.columns);
    parts.L.triangularView<Eigen::Lower>().solveInPlace(right);
    parts.L.transpose().triangularView<Eigen::Upper>().solveInPlace(right);
    if (parts.border > 0)
      right.noalias() -= parts.influence * MatrixXd::Map(lambda.data(), parts.border, parts.columns);
  }
  for (std::size_t column = 0; column < x.size(); ++column)
  {
    double* mine = nullptr;
    check(VecGetArrayWrite(x[column], &mine));
    const double* whole = parts.here() ? &parts.right[area(parts.dofs, static_cast<int>(column))] : nullptr;
    MPI_Scatterv(whole, parts.shares.counts.data(), parts.shares.starts.data(), MPI_DOUBLE, mine, parts.own(),
                 MPI_DOUBLE, 0, parts.comm);
    check(VecRestoreArrayWrite(x[column], &mine));
  }
}

double Factor::entries() const
{
  if (parts_->distributed) return parts_->distributed->entries();
  double entries =
      parts_->cholesky ? parts_->cholesky->entries() : .5 * static_cast<double>(parts_->dofs) * parts_->dofs;
  MPI_Bcast(&entries, 1, MPI_DOUBLE, 0, parts_->comm);
  return entries;
}

double factor_memory(Mat A, Mat B)
{
  const int dofs = rows_of(A), border = rows_of(B);
  const Plan plan = planned(Factor::Kind::automatic, A, B);
  if (plan.kind == Factor::Kind::dense) return 8 * static_cast<double>(area(dofs, dofs + border));
  if (plan.kind == Factor::Kind::supernodal) return plan.memory;
  return distributed_memory(bordered(A, B), plan.order.position, dofs, border, comm_of(A));
}

void solve(const Factor& factor, Vec b, Vec x)
{
  const std::vector<double> nothing(factor.forward(std::span(&b, 1)).size(), 0.);
  factor.backward(nothing, std::span(&x, 1));
}

} // namespace squeal
