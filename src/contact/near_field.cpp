#include "near_field.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

constexpr int bins_of_octave = 8, bins_above_unit = 192; // 24 octaves

double size_of(const PairBlock& block)
{
  double size = 0;
  for (const PairVector& row : block)
    for (const double entry : row) size = std::max(size, std::abs(entry));
  return size;
}

} // namespace

NearFieldBuilder::NearFieldBuilder(std::size_t pairs, int directions)
    : pairs_(pairs), rows_(directions), sizes_(pairs, Sizes{})
{
}

PairBlock NearFieldBuilder::block(const CondensedStrip& strip, std::size_t i, std::size_t j) const
{
  PairBlock result{};
  for (std::size_t l = 0; l < rows_.per_pair(); ++l)
    for (std::size_t k = 0; k < rows_.per_pair(); ++k)
    {
      const std::size_t row = rows_.normal(i) + k, column = rows_.normal(j) + l;
      result[k][l] = row >= column ? strip.entry(row, column) : strip.entry(column, row);
    }
  return result;
}

int NearFieldBuilder::bin_of(double size) const
{
  const double octaves = std::log2(size / unit_);
  return static_cast<int>(std::clamp(std::floor(bins_of_octave * octaves) + bins - bins_above_unit, 0., bins - 1.));
}

void NearFieldBuilder::measure(const CondensedStrip& strip)
{
  for (std::size_t j = rows_.pair_of(strip.first); j < rows_.pair_of(strip.last); ++j)
    for (std::size_t i = j; i < pairs_; ++i)
    {
      const PairBlock now = block(strip, i, j);
      if (i == j) diagonal_.push_back(now);
      const double size = size_of(now);
      if (size == 0 || !std::isfinite(size)) continue;
      if (unit_ == 0) unit_ = size;
      const auto bin = static_cast<std::size_t>(bin_of(size));
      sizes_[i][bin] += size;
      if (i != j) sizes_[j][bin] += size;
    }
}

/// The size below which the blocks of a pair's rows add up to the share NearField::left_out of its own block.
double NearFieldBuilder::limit_of(std::size_t pair) const
{
  const double own = size_of(diagonal_[pair]);
  double sum = 0;
  int bin = -1, largest = 0;
  while (++bin < bins)
  {
    const double here = sizes_[pair][static_cast<std::size_t>(bin)];
    sum += here;
    if (here > 0) largest = bin;
    if (sum > NearField::left_out * own) break;
  }
  return unit_ * std::exp2((std::min(bin, largest) + bins_above_unit - bins) / static_cast<double>(bins_of_octave));
}

void NearFieldBuilder::append(Blocks& blocks, std::size_t column, const PairBlock& block, bool transposed) const
{
  blocks.columns.push_back(column);
  for (std::size_t k = 0; k < rows_.per_pair(); ++k)
    for (std::size_t l = 0; l < rows_.per_pair(); ++l)
      blocks.values.push_back(static_cast<float>(transposed ? block[l][k] : block[k][l]));
}

/// The blocks side by side in each run.
NearField::PairRow NearFieldBuilder::row_of(const Blocks& blocks) const
{
  NearField::PairRow row;
  const std::size_t n = rows_.per_pair();
  const auto& [columns, values] = blocks;
  row.values.reserve(values.size());
  for (std::size_t p = 0, end = 0; p < columns.size(); p = end)
  {
    for (end = p + 1; end < columns.size() && columns[end] == columns[end - 1] + 1;) ++end;
    row.runs.push_back({rows_.normal(columns[p]), (end - p) * n});
    for (std::size_t k = 0; k < n; ++k)
      for (std::size_t q = p; q < end; ++q)
        for (std::size_t l = 0; l < n; ++l) row.values.push_back(values[(q * n + k) * n + l]);
  }
  return row;
}

/// Blocks that are negligible in both pairs' rows are left out, so that no row misses more than its share. The column
/// of a pair completes its rows: what is left of the diagonal has waited, and the rest is this column transposed.
void NearFieldBuilder::collect(const CondensedStrip& strip)
{
  if (limits_.empty())
  {
    for (std::size_t pair = 0; pair < pairs_; ++pair) limits_.push_back(limit_of(pair));
    sizes_ = {};
    waiting_.resize(pairs_);
  }
  for (std::size_t j = rows_.pair_of(strip.first); j < rows_.pair_of(strip.last); ++j)
  {
    Blocks own = std::exchange(waiting_[j], {});
    for (std::size_t i = j; i < pairs_; ++i)
    {
      const PairBlock now = block(strip, i, j);
      if (i != j && !(size_of(now) > 0 && size_of(now) >= std::min(limits_[i], limits_[j]))) continue;
      append(own, i, now, i != j);
      if (i != j) append(waiting_[i], j, now, false);
    }
    near_.rows.push_back(row_of(own));
  }
}

NearField NearFieldBuilder::finish()
{
  return std::move(near_);
}

std::size_t NearField::entries() const
{
  std::size_t entries = 0;
  for (const PairRow& row : rows) entries += row.values.size();
  return entries;
}

} // namespace squeal
