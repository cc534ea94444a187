#include "squeal/contact/contact_operator.hpp"

#include "near_field.hpp"
#include "squeal/algebra/panel.hpp"
#include "squeal/algebra/simd.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Core>
#include <string>

namespace squeal
{

namespace
{

constexpr std::size_t fits_the_cache = 250; // rows: sweeping over W itself is as quick

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

SQUEAL_SIMD void add_runs(const NearField::PairRow& row, std::size_t number, const PairVector& factors, float* target)
{
  const float* values = row.values.data();
  for (const auto& [first, count] : row.runs)
  {
    add_block(values, count, number, factors, target + first);
    values += number * count;
  }
}

} // namespace

SQUEAL_SIMD void add_rows(const float* rows, std::size_t length, std::size_t number, const PairVector& factors,
                          float* target)
{
  add_block(rows, length, number, factors, target);
}

void ContactOperator::multiply(std::span<const double> x, std::span<double> y) const
{
  if (products_) return multiply_by_factor(x, y);
  std::vector<double> from(x.begin(), x.end()), to(x.size());
  multiply_stored(from, to);
  std::ranges::copy(to, y.begin());
}

void ContactOperator::add_product(std::size_t pair, const PairVector& change, std::span<double> w) const
{
  const PairMatrixView W(values_, pairs(), directions_);
  add_whole_rows(W.row(pair, 0).data(), size(), W.rows_per_pair(), change, w.data());
}

void ContactOperator::add_near_product(std::size_t pair, const PairVector& change, std::span<float> w) const
{
  add_product_in_patch(pair, change, w);
  add_runs(near_.outside[pair], PairRows<std::size_t>(directions_).per_pair(), change, w.data());
}

void ContactOperator::add_product_in_patch(std::size_t pair, const PairVector& change, std::span<float> w) const
{
  add_runs(near_.inside[pair], PairRows<std::size_t>(directions_).per_pair(), change, w.data());
}

void ContactOperator::add_product_beyond_patch(std::size_t pair, const PairVector& change, std::span<float> w) const
{
  const NearField::PairRow& row = shares_patches() ? beyond_[pair] : near_.outside[pair];
  add_runs(row, PairRows<std::size_t>(directions_).per_pair(), change, w.data());
}

double ContactOperator::near_share() const
{
  const auto n = static_cast<double>(size());
  return n == 0 ? 0 : static_cast<double>(near_.entries()) / (n * n);
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

void ContactOperator::set_diagonal(std::vector<PairBlock> blocks)
{
  diagonal_ = std::move(blocks);
  double largest = 0;
  for (const PairBlock& A : diagonal_)
    for (std::size_t k = 0; k < 3; ++k) largest = std::max(largest, A[k][k]);
  for (const PairBlock& A : diagonal_) scale_.push_back(natural_scale(A, largest));
}

ContactOperator make_contact_operator(std::vector<double> W, int pairs, int directions)
{
  const auto count = static_cast<std::size_t>(pairs);
  const PairMatrixView view(W, count, directions);
  const std::size_t n = view.size();
  if (W.size() != n * n)
    throw Error("contact: " + std::to_string(pairs) + " pairs of " + std::to_string(view.rows_per_pair()) +
                " rows need " + std::to_string(n * n) + " entries of W, not " + std::to_string(W.size()));
  ContactOperator op;
  op.pairs_ = count;
  op.directions_ = directions;
  if (n > fits_the_cache)
  {
    NearFieldBuilder builder(count, directions, PETSC_COMM_SELF);
    const CondensedStrip whole{0, n, n, W.data()};
    builder.measure(whole);
    builder.agree();
    builder.collect(whole);
    op.near_ = builder.finish();
    op.set_diagonal(builder.diagonal());
  }
  else
  {
    std::vector<PairBlock> blocks;
    for (std::size_t pair = 0; pair < count; ++pair) blocks.push_back(view.block(pair, pair));
    op.set_diagonal(std::move(blocks));
  }
  op.values_ = std::move(W);
  return op;
}

bool stays_in_factor(double rows, double border_entries, double free)
{
  const double half = rows * rows / 2; // of a symmetric W, which a product reads; or E twice
  return 2 * border_entries < half || sizeof(double) * 2 * half > free / 4;
}

ContactOperator make_contact_operator(const ScaledProducts& W, OperatorStorage storage, int pairs, int directions,
                                      MPI_Comm comm)
{
  ContactOperator op;
  const bool by_factor = storage == OperatorStorage::by_factor;
  NearFieldBuilder builder(static_cast<std::size_t>(pairs), directions, by_factor ? PETSC_COMM_SELF : comm);
  std::vector<double> values;
  const auto scaled = [&](const CondensedStrip& strip)
  {
    values.assign(strip.values, strip.values + (strip.last - strip.first) * strip.height);
    for (double& entry : values) entry *= W.scale;
    for (std::size_t j = strip.first; !W.diagonal.empty() && j < strip.last; ++j)
      values[(j - strip.first) * (strip.height + 1)] += W.diagonal[j];
    return CondensedStrip{strip.first, strip.last, strip.height, values.data()};
  };
  const bool first = rank_of(comm) == 0;
  if (by_factor)
  {
    op.products_ = W;
    if (ranks_of(comm) > 1) op.shared_by_ = comm;
    W.products.read([&](const CondensedStrip& strip) { builder.measure(scaled(strip)); });
    if (first) builder.agree();
    W.products.read([&](const CondensedStrip& strip) { builder.collect(scaled(strip)); });
    if (first) op.near_ = builder.finish();
  }
  else
  {
    const std::size_t rows = PairRows<std::size_t>(directions).rows_of(static_cast<std::size_t>(pairs));
    W.products.read(
        [&](const CondensedStrip& strip)
        {
          const CondensedStrip now = scaled(strip);
          builder.measure(now);
          op.append_strips(now);
        },
        op.share_columns(rows, comm));
    builder.agree();
    op.for_each_strip([&](const CondensedStrip& strip) { builder.collect(strip); });
    op.near_ = builder.finish();
  }
  if (first)
  {
    op.pairs_ = static_cast<std::size_t>(pairs);
    op.directions_ = directions;
    op.set_diagonal(builder.diagonal());
  }
  if (op.shared_by_ != MPI_COMM_NULL) op.share_patches();
  return op;
}

} // namespace squeal
