#include "squeal/contact/contact_operator.hpp"
#include "near_field.hpp"
#include "squeal/algebra/panel.hpp"
#include "squeal/algebra/simd.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/free_memory.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Core>
#include <numeric>
#include <string>
#include <utility>

namespace squeal
{

namespace
{

/// In the precision of the target.
template <class Entry, class Sum> SQUEAL_INLINE void add_block(const Entry* __restrict rows, std::size_t length,
                                                               std::size_t number, const PairVector& factors,
                                                               Sum* __restrict target)
{
  const auto x = static_cast<Sum>(factors[0]), y = static_cast<Sum>(factors[1]), z = static_cast<Sum>(factors[2]);
  const Entry *const second = rows + length, *const third = second + length;
  if (number == 1)
    for (std::size_t j = 0; j < length; ++j) target[j] += x * rows[j];
  else if (number == 2)
    for (std::size_t j = 0; j < length; ++j) target[j] += x * rows[j] + y * second[j];
  else
    for (std::size_t j = 0; j < length; ++j) target[j] += x * rows[j] + y * second[j] + z * third[j];
}

SQUEAL_SIMD void add_whole_rows(const double* rows, std::size_t length, std::size_t number, const PairVector& factors,
                                double* target)
{
  add_block(rows, length, number, factors, target);
}

SQUEAL_SIMD void add_runs(const NearRow& row, std::size_t number, const PairVector& factors, float* target)
{
  for (const auto& [first, count, begin] : row.runs)
    add_block(row.values.data() + begin, count, number, factors, target + first);
}

/// The turn in which each rank has the pairs of `order` from begins[rank] to ends[rank].
Turn turn_of(const std::vector<std::size_t>& order, const std::vector<std::size_t>& begins,
             const std::vector<std::size_t>& ends, MPI_Comm comm)
{
  Turn turn;
  for (std::size_t rank = 0; rank < begins.size(); ++rank)
  {
    const std::size_t before = turn.order.size();
    turn.order.insert(turn.order.end(), order.begin() + to_int(begins[rank]), order.begin() + to_int(ends[rank]));
    turn.counts.push_back(to_int(ends[rank] - begins[rank]));
    if (to_int(rank) != rank_of(comm)) continue;
    turn.begin = before;
    turn.end = turn.order.size();
  }
  return turn;
}

} // namespace

Turn all_pairs(std::size_t pairs)
{
  Turn all{std::vector<std::size_t>(pairs), {to_int(pairs)}, 0, pairs};
  std::iota(all.order.begin(), all.order.end(), 0);
  return all;
}

std::vector<std::size_t> column_shares(std::size_t rows, MPI_Comm comm)
{
  constexpr std::size_t together = 24; // columns: whole pairs of two or three rows, and whole tiles
  const int ranks = ranks_of(comm);
  std::vector<std::size_t> firsts;
  for (int rank = 0; rank < ranks; ++rank) // (1 - column/rows)^2 = 1 - rank/ranks
    firsts.push_back(
        static_cast<std::size_t>((1 - std::sqrt(1 - static_cast<double>(rank) / ranks)) * static_cast<double>(rows)) /
        together * together);
  firsts.push_back(rows);
  return firsts;
}

ContactOperator::ContactOperator(std::vector<double> columns, int pairs, int directions, MPI_Comm comm)
    : directions_(directions), columns_(std::move(columns))
{
  const std::size_t rows = PairRows<std::size_t>(directions).rows_of(static_cast<std::size_t>(pairs));
  const std::vector<std::size_t> shares = column_shares(rows, comm);
  first_ = shares[static_cast<std::size_t>(rank_of(comm))];
  last_ = shares[static_cast<std::size_t>(rank_of(comm)) + 1];
  if (ranks_of(comm) > 1) shared_by_ = comm;
  const CondensedStrip own{first_, last_, rows - first_, columns_.data()};
  set_diagonal(own, comm);
  if (static_cast<double>(rows * rows) > entries_in_cache) set_near_field(own, comm);
  if (near_.empty()) turns_ = {all_pairs(diagonal_.size())};
}

void ContactOperator::set_diagonal(const CondensedStrip& own, MPI_Comm comm)
{
  const PairRows<std::size_t> rows(directions_);
  std::vector<PairBlock> blocks;
  for (std::size_t pair = rows.pair_of(first_); pair < rows.pair_of(last_); ++pair)
    blocks.push_back(block_of(own, rows, pair, pair));
  for (int rank = 0; rank < ranks_of(comm); ++rank)
  {
    std::vector<PairBlock> part = blocks;
    broadcast(part, comm, rank);
    diagonal_.insert(diagonal_.end(), part.begin(), part.end());
  }
  double largest = 0;
  for (const PairBlock& A : diagonal_)
    for (std::size_t k = 0; k < 3; ++k) largest = std::max(largest, A[k][k]);
  for (const PairBlock& A : diagonal_) scale_.push_back(natural_scale(A, largest));
}

void ContactOperator::set_near_field(const CondensedStrip& own, MPI_Comm comm)
{
  NearField near = make_near_field(own, pairs(), directions_, comm);
  near_ = std::move(near.rows);
  const std::vector<std::size_t> begins(near.of_ranks.begin(), near.of_ranks.end() - 1),
      ends(near.of_ranks.begin() + 1, near.of_ranks.end());
  std::vector<std::size_t> middles;
  for (std::size_t rank = 0; rank < begins.size(); ++rank) middles.push_back((begins[rank] + ends[rank]) / 2);
  const bool alone = ends.front() == ends.back();
  if (alone)
    turns_ = {turn_of(near.order, begins, ends, comm)};
  else
    turns_ = {turn_of(near.order, begins, middles, comm), turn_of(near.order, middles, ends, comm)};
}

void ContactOperator::multiply(std::span<const double> x, std::span<double> y) const
{
  const std::vector<double> from(x.begin(), x.end());
  std::vector<double> to(x.size());
  add_symmetric_product(columns_.data(), size() - first_, last_ - first_, from.data() + first_, to.data() + first_);
  if (shared_by_ != MPI_COMM_NULL)
  {
    const bool first = rank_of(shared_by_) == 0; // a sum on all ranks may differ in the last bit
    MPI_Reduce(first ? MPI_IN_PLACE : to.data(), to.data(), to_int(to.size()), MPI_DOUBLE, MPI_SUM, 0, shared_by_);
    MPI_Bcast(to.data(), to_int(to.size()), MPI_DOUBLE, 0, shared_by_);
  }
  std::ranges::copy(to, y.begin());
}

void ContactOperator::multiply_alone(std::span<const double> x, std::span<double> y) const
{
  std::ranges::fill(y, 0.);
  add_symmetric_product(entries().data(), size(), size(), x.data(), y.data());
}

void ContactOperator::hold_whole() const
{
  if (shared_by_ == MPI_COMM_NULL || held_whole_) return;
  const std::size_t rows = size();
  held_whole_ = true;
  on_rank_zero(shared_by_, [&] { whole_.resize(rows * rows); });
  const std::vector<std::size_t> shares = column_shares(rows, shared_by_);
  for (int rank = 0; rank < ranks_of(shared_by_); ++rank)
  {
    std::vector<double> part = columns_;
    broadcast(part, shared_by_, rank);
    if (rank_of(shared_by_) != 0) continue;
    const std::size_t first = shares[static_cast<std::size_t>(rank)];
    const double* column = part.data();
    for (std::size_t j = first; j < shares[static_cast<std::size_t>(rank) + 1]; ++j, column += rows - first)
      for (std::size_t i = j; i < rows; ++i) whole_[i * rows + j] = whole_[j * rows + i] = column[i - first];
  }
}

void ContactOperator::add_product(std::size_t pair, const PairVector& change, std::span<double> w) const
{
  const PairRows<std::size_t> rows(directions_);
  add_whole_rows(&entries()[rows.normal(pair) * size()], size(), rows.per_pair(), change, w.data());
}

void ContactOperator::add_product(std::size_t pair, const PairVector& change, std::span<float> w) const
{
  add_runs(near_[pair], PairRows<std::size_t>(directions_).per_pair(), change, w.data());
}

double ContactOperator::largest_eigenvalue(std::span<const double> roots, int iterations) const
{
  std::vector<double> x(size()), scaled(size()), y(size());
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = 1 + 0.1 * std::sin(static_cast<double>(i));
  double largest = 0;
  for (int k = 0; k < iterations; ++k)
  {
    const double length = std::sqrt(dot(x, x));
    if (length == 0) break;
    for (double& entry : x) entry /= length;
    std::ranges::transform(x, roots, scaled.begin(), std::multiplies<>());
    multiply(scaled, y);
    std::ranges::transform(y, roots, y.begin(), std::multiplies<>());
    largest = dot(x, y);
    std::swap(x, y);
  }
  return largest;
}

ContactOperator make_contact_operator(std::vector<double> W, int pairs, int directions)
{
  const PairRows<std::size_t> rows(directions);
  const std::size_t n = rows.rows_of(static_cast<std::size_t>(pairs));
  if (W.size() != n * n)
    throw Error(format("contact: %d pairs of %zu rows need %zu entries of W, not %zu", pairs, rows.per_pair(), n * n,
                       W.size()));
  return {std::move(W), pairs, directions, PETSC_COMM_SELF};
}

ContactOperator make_contact_operator(const Factor& factor, double scale, const std::vector<double>& added, int pairs,
                                      int directions, MPI_Comm comm)
{
  const std::size_t rows = PairRows<std::size_t>(directions).rows_of(static_cast<std::size_t>(pairs));
  std::vector<double> columns;
  if (ranks_of(comm) == 1 || static_cast<double>(rows * rows) < entries_per_exchange)
  {
    columns = factor.condensed(scale);
    for (std::size_t i = 0; i < added.size() && !columns.empty(); ++i) columns[i * (rows + 1)] += added[i];
    return rank_of(comm) == 0 ? make_contact_operator(std::move(columns), pairs, directions) : ContactOperator();
  }
  const std::vector<std::size_t> shares = column_shares(rows, comm);
  const std::size_t first = shares[static_cast<std::size_t>(rank_of(comm))],
                    last = shares[static_cast<std::size_t>(rank_of(comm)) + 1], height = rows - first;
  columns = vector_on_large_pages((last - first) * height);
  columns.resize((last - first) * height);
  factor.read_condensed(
      [&](const CondensedStrip& strip)
      {
        for (std::size_t j = strip.first; j < strip.last; ++j)
          for (std::size_t i = j; i < rows; ++i)
            columns[(j - first) * height + i - first] =
                scale * strip.entry(i, j) + (i == j && !added.empty() ? added[i] : 0);
      },
      shares);
  return {std::move(columns), pairs, directions, comm};
}

namespace
{

/// Entries that are all different, the same for any number of ranks: a start for inverse iteration.
Owned<Vec> uneven_vector(Mat A)
{
  Owned<Vec> x = vector_of_columns(A);
  const auto [first, last] = own_range(x);
  for (PetscInt i = first; i < last; ++i)
    check(VecSetValue(x, i, 1 + 0.5 * std::sin(7. * static_cast<double>(i) + 1), INSERT_VALUES));
  finish(x);
  return x;
}

/// Inverse iteration: x becomes the motion that A resists least, next to D = diag(A); returns x'A x / x'D x.
double least_resistance(const Factor& factor, Vec D, Vec x)
{
  const auto load = zeros_like(x), scaled = zeros_like(x);
  double quotient = 1;
  for (int iteration = 0; iteration < 3; ++iteration)
  {
    const double size = norm_of(x, NORM_INFINITY);
    if (!std::isfinite(size) || size == 0) return 0;
    check(VecScale(x, 1 / size));
    check(VecPointwiseMult(load, D, x));
    solve(factor, load, x);
    check(VecPointwiseMult(scaled, D, x));
    quotient = dot(x, load) / dot(x, scaled);
  }
  return quotient;
}

PetscInt row_of_largest_entry(Vec x)
{
  PetscInt where = 0;
  double value = 0;
  const auto size = zeros_like(x);
  check(VecCopy(x, size));
  check(VecAbs(size));
  check(VecMax(size, &where, &value));
  return where;
}

/// After a failed factorisation: finds the motion that A resists least, with a little added to A's diagonal. If that
/// matrix does not factor either, A is indefinite.
void find_loose(Mat A, Vec D, const FactorOptions& options, Factored& result)
{
  const double largest = norm_of(D, NORM_INFINITY);
  const auto x = uneven_vector(A);
  const auto uniform = zeros_like(D);
  check(VecSet(uniform, 1));
  bool failed = true;
  for (double part = 1e-8; failed && part < 100; part *= 10)
  {
    const Owned<Mat> shifted = copy_of(A);
    check(MatShift(shifted, largest > 0 ? part * largest : 1));
    const Factor factor(shifted, nullptr, options);
    failed = factor.failed();
    if (failed) result.indefinite = true;
    if (!failed) least_resistance(factor, uniform, x);
  }
  result.loose = row_of_largest_entry(x);
}

} // namespace

Factored factor_positive(Mat A, const Interface& interface, const FactorOptions& options)
{
  Factored result;
  Mat B = interface.pairs > 0 ? interface.B.get() : nullptr;
  result.factor = Factor(A, B, options);
  const Owned<Vec> D = vector_of_columns(A);
  check(MatGetDiagonal(A, D));
  if (result.factor.failed())
  {
    find_loose(A, D, options, result);
    return result;
  }
  // a singular matrix often factors without complaint; rounding leaves it this much resistance and no more
  const auto x = uneven_vector(A);
  result.resistance = least_resistance(result.factor, D, x);
  if (!(result.resistance > 1e-14)) result.loose = row_of_largest_entry(x);
  return result;
}

Factor factor_held(Mat A, const Interface& interface, const DofNames& names, const FactorOptions& options)
{
  auto [factor, loose, indefinite, resistance] = factor_positive(A, interface, options);
  if (loose)
    throw Error((indefinite ? "not positive definite: driven on, not back, is" : "singular: nothing resists") +
                (" a motion that is largest at " + describe(names, *loose)) + "; give it a support, a spring or mass");
  return std::move(factor);
}

namespace
{

/// B x, without the rows that are not taken.
Eigen::VectorXd rows_taken(const Interface& interface, const std::vector<char>& taken, Vec x)
{
  const std::vector<double> rows = relative(interface, x);
  const auto size = static_cast<Eigen::Index>(rows.size());
  return Eigen::VectorXd::Map(rows.data(), size)
      .cwiseProduct(Eigen::VectorX<char>::Map(taken.data(), size).cast<double>());
}

} // namespace

std::vector<double> forces_on_rows(const Interface& interface, const std::vector<char>& taken, Vec x)
{
  constexpr double rounding = 1e-14;
  constexpr int most_passes = 200;
  const Owned<Vec> work = zeros_like(x);
  Eigen::VectorXd residual = rows_taken(interface, taken, x), z = Eigen::VectorXd::Zero(residual.size()),
                  along = residual;
  double square = residual.squaredNorm();
  const double enough = rounding * rounding * square;
  for (int pass = 0; square > enough && pass < most_passes; ++pass)
  {
    check(VecSet(work, 0));
    add_reactions(interface, {along.begin(), along.end()}, work);
    const Eigen::VectorXd image = rows_taken(interface, taken, work);
    const double part = square / along.dot(image);
    z += part * along;
    residual -= part * image;
    const double next = residual.squaredNorm();
    along = residual + next / square * along;
    square = next;
  }
  return {z.begin(), z.end()};
}

} // namespace squeal
