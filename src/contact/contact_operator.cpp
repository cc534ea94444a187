#include "squeal/contact/contact_operator.hpp"

#include "squeal/algebra/panel.hpp"
#include "squeal/algebra/simd.hpp"
#include "squeal/base/error.hpp"
#include "squeal/contact/complementarity.hpp"

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

SQUEAL_SIMD void add_runs(const NearField& near, std::size_t pair, std::size_t number, const PairVector& factors,
                          float* target)
{
  const float* values = &near.values[near.values_of[pair]];
  for (std::size_t run = near.runs_of[pair]; run < near.runs_of[pair + 1]; ++run)
  {
    const auto [first, count] = near.runs[run];
    add_block(values, count, number, factors, target + first);
    values += number * count;
  }
}

/// The largest entry of each block of a pair's rows.
std::vector<double> block_sizes(const PairMatrixView& W, std::size_t pair, std::size_t pairs)
{
  std::vector<double> sizes(pairs, 0.);
  for (std::size_t j = 0; j < pairs; ++j)
    for (const PairVector& row : W.block(pair, j))
      for (const double entry : row) sizes[j] = std::max(sizes[j], std::abs(entry));
  return sizes;
}

/// The size below which the blocks of a pair's rows add up to the share NearField::left_out of its own block.
double negligible_size(const std::vector<double>& sizes, std::size_t pair)
{
  std::vector<double> ascending = sizes;
  std::sort(ascending.begin(), ascending.end());
  double sum = 0;
  for (const double size : ascending)
  {
    sum += size;
    if (sum > NearField::left_out * sizes[pair]) return size;
  }
  return ascending.back();
}

/// Blocks that are negligible in both pairs' rows are left out, so that no row misses more than its share.
NearField near_field(const PairMatrixView& W, std::size_t pairs, int directions)
{
  NearField near;
  const PairRows<std::size_t> rows(directions);
  std::vector<double> limits;
  for (std::size_t i = 0; i < pairs; ++i) limits.push_back(negligible_size(block_sizes(W, i, pairs), i));
  for (std::size_t i = 0; i < pairs; ++i)
  {
    near.runs_of.push_back(near.runs.size());
    near.values_of.push_back(near.values.size());
    const std::vector<double> sizes = block_sizes(W, i, pairs);
    for (std::size_t j = 0; j < pairs; ++j)
    {
      if (sizes[j] < std::min(limits[i], limits[j])) continue;
      const bool follows =
          near.runs.size() > near.runs_of.back() && near.runs.back().first + near.runs.back().count == rows.normal(j);
      if (!follows) near.runs.push_back({rows.normal(j), 0});
      near.runs.back().count += rows.per_pair();
    }
    for (std::size_t run = near.runs_of.back(); run < near.runs.size(); ++run)
      for (std::size_t k = 0; k < rows.per_pair(); ++k)
        for (const double entry : W.row(i, k).subspan(near.runs[run].first, near.runs[run].count))
          near.values.push_back(static_cast<float>(entry));
  }
  near.runs_of.push_back(near.runs.size());
  return near;
}

} // namespace

SQUEAL_SIMD void add_rows(const float* rows, std::size_t length, std::size_t number, const PairVector& factors,
                          float* target)
{
  add_block(rows, length, number, factors, target);
}

void ContactOperator::multiply(std::span<const std::span<const double>> x, std::span<const std::span<double>> y) const
{
  const std::size_t n = size(), lanes = lanes_for(x.size());
  if (x.empty()) return;
  if (lanes == 1) return multiply_one(x[0], y[0]);
  std::vector<double> from(n * lanes), to(n * lanes);
  for (std::size_t k = 0; k < x.size(); ++k)
    for (std::size_t i = 0; i < n; ++i) from[i * lanes + k] = x[k][i];
  dense_product(values_.data(), n, lanes, from.data(), to.data());
  for (std::size_t k = 0; k < y.size(); ++k)
    for (std::size_t i = 0; i < n; ++i) y[k][i] = to[i * lanes + k];
}

void ContactOperator::add_product(std::size_t pair, const PairVector& change, std::span<double> w) const
{
  const PairMatrixView W(values_, pairs(), directions_);
  add_whole_rows(W.row(pair, 0).data(), size(), W.rows_per_pair(), change, w.data());
}

void ContactOperator::add_near_product(std::size_t pair, const PairVector& change, std::span<float> w) const
{
  add_runs(near_, pair, PairRows<std::size_t>(directions_).per_pair(), change, w.data());
}

double ContactOperator::near_share() const
{
  return values_.empty() ? 0 : static_cast<double>(near_.values.size()) / static_cast<double>(values_.size());
}

Eigen::MatrixXd ContactOperator::submatrix(std::span<const Eigen::Index> rows) const
{
  const auto n = static_cast<Eigen::Index>(size());
  return Eigen::MatrixXd::Map(values_.data(), n, n)(rows, rows);
}

double ContactOperator::largest_eigenvalue(int iterations) const
{
  const auto n = static_cast<Eigen::Index>(size());
  return squeal::largest_eigenvalue(Eigen::MatrixXd::Map(values_.data(), n, n), iterations);
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
  double largest = 0;
  for (std::size_t pair = 0; pair < count; ++pair)
  {
    op.diagonal_.push_back(view.block(pair, pair));
    for (std::size_t k = 0; k < 3; ++k) largest = std::max(largest, op.diagonal_.back()[k][k]);
  }
  for (const PairBlock& A : op.diagonal_) op.scale_.push_back(natural_scale(A, largest));
  if (n > fits_the_cache) op.near_ = near_field(view, count, directions);
  op.values_ = std::move(W);
  return op;
}

} // namespace squeal
