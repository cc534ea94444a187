#include "near_field.hpp"

#include <algorithm>
#include <cmath>

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

/// Blocks that are negligible in both pairs' rows are left out, so that no row misses more than its share.
void NearFieldBuilder::collect(const CondensedStrip& strip)
{
  if (limits_.empty())
    for (std::size_t pair = 0; pair < pairs_; ++pair) limits_.push_back(limit_of(pair));
  sizes_ = {};
  for (std::size_t j = rows_.pair_of(strip.first); j < rows_.pair_of(strip.last); ++j)
    for (std::size_t i = j; i < pairs_; ++i)
    {
      const PairBlock now = block(strip, i, j);
      if (i != j && !(size_of(now) > 0 && size_of(now) >= std::min(limits_[i], limits_[j]))) continue;
      blocks_.push_back({i, j});
      for (std::size_t k = 0; k < rows_.per_pair(); ++k)
        for (std::size_t l = 0; l < rows_.per_pair(); ++l) values_.push_back(static_cast<float>(now[k][l]));
    }
}

NearField NearFieldBuilder::finish()
{
  struct Place
  {
    std::size_t column, block;
    bool turned; // the block is that of the transposed place
  };
  std::vector<std::vector<Place>> places(pairs_); // of each row, by rising column
  for (std::size_t b = 0; b < blocks_.size(); ++b)
  {
    const auto [i, j] = blocks_[b];
    places[i].push_back({j, b, false});
    if (i != j) places[j].push_back({i, b, true});
  }
  NearField near;
  const std::size_t n = rows_.per_pair();
  for (const std::vector<Place>& row : places)
  {
    near.runs_of.push_back(near.runs.size());
    near.values_of.push_back(near.values.size());
    for (std::size_t p = 0, end = 0; p < row.size(); p = end)
    {
      for (end = p + 1; end < row.size() && row[end].column == row[end - 1].column + 1;) ++end;
      near.runs.push_back({rows_.normal(row[p].column), (end - p) * n});
      for (std::size_t k = 0; k < n; ++k)
        for (std::size_t q = p; q < end; ++q)
          for (std::size_t l = 0; l < n; ++l)
            near.values.push_back(values_[(row[q].block * n + (row[q].turned ? l : k)) * n + (row[q].turned ? k : l)]);
    }
  }
  near.runs_of.push_back(near.runs.size());
  return near;
}

} // namespace squeal
