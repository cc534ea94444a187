#include "near_field.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/disjoint_sets.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace squeal
{

namespace
{

constexpr int bins_of_octave = 8, bins_above_unit = 192; // 24 octaves
constexpr double strong_action = 0.5;                    // on a patch, over its own
constexpr std::size_t most_patches = 64;                 // before any are joined

/// Rounded down.
int eighths_of_octaves(double size)
{
  return static_cast<int>(std::floor(bins_of_octave * std::log2(size)));
}

double size_of(const PairBlock& block)
{
  double size = 0;
  for (const PairVector& row : block)
    for (const double entry : row) size = std::max(size, std::abs(entry));
  return size;
}

} // namespace

NearField::PairRow part_of(const NearField::PairRow& row, std::size_t of_a_pair,
                           const std::function<bool(std::size_t pair)>& taken)
{
  NearField::PairRow part;
  const float* values = row.values.data();
  for (const auto& [first, count] : row.runs)
  {
    const auto takes = [&, first = first](std::size_t column) { return taken((first + column) / of_a_pair); };
    for (std::size_t from = 0, to = 0; from < count; from = to)
    {
      to = from + of_a_pair;
      if (!takes(from)) continue;
      while (to < count && takes(to)) to += of_a_pair;
      part.runs.push_back({first + from, to - from});
      for (std::size_t k = 0; k < of_a_pair; ++k)
        part.values.insert(part.values.end(), values + k * count + from, values + k * count + to);
    }
    values += of_a_pair * count;
  }
  part.values.shrink_to_fit();
  return part;
}

void set_patches(NearField& near, const std::vector<std::size_t>& patch_of, std::size_t of_a_pair)
{
  std::map<std::size_t, std::vector<std::size_t>> patches;
  for (std::size_t i = 0; i < patch_of.size(); ++i)
  {
    const NearField::PairRow row = std::exchange(near.inside[i], {});
    const auto own = [&](std::size_t j) { return patch_of[j] == patch_of[i]; };
    near.inside[i] = part_of(row, of_a_pair, own);
    near.outside[i] = part_of(row, of_a_pair, std::not_fn(own));
    patches[patch_of[i]].push_back(i);
  }
  near.patches.clear();
  for (auto& [patch, pairs] : patches) near.patches.push_back(std::move(pairs));
}

NearFieldBuilder::NearFieldBuilder(std::size_t pairs, int directions, MPI_Comm comm)
    : pairs_(pairs), rows_(directions), comm_(comm), sizes_(pairs, Sizes{})
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
  return std::clamp(eighths_of_octaves(size) - *unit_ + bins - bins_above_unit, 0, bins - 1);
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
      if (!unit_) unit_ = eighths_of_octaves(size);
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
  return std::exp2((*unit_ + std::min(bin, largest) + bins_above_unit - bins) / static_cast<double>(bins_of_octave));
}

/// Adds up the sizes of all ranks' blocks, from the first rank's unit on, and gathers the diagonal.
void NearFieldBuilder::agree()
{
  constexpr int none = std::numeric_limits<int>::min();
  std::vector<int> units(static_cast<std::size_t>(ranks_of(comm_)));
  const int own = unit_.value_or(none);
  MPI_Allgather(&own, 1, MPI_INT, units.data(), 1, MPI_INT, comm_);
  const auto first = std::find_if(units.begin(), units.end(), [](int unit) { return unit != none; });
  if (first != units.end() && unit_ && *unit_ != *first)
    for (Sizes& sizes : sizes_)
    {
      const Sizes before = std::exchange(sizes, Sizes{});
      for (int bin = 0; bin < bins; ++bin)
        sizes[static_cast<std::size_t>(std::clamp(bin + *unit_ - *first, 0, bins - 1))] +=
            before[static_cast<std::size_t>(bin)];
    }
  if (first != units.end()) unit_ = *first;
  if (units.size() > 1)
  {
    constexpr std::size_t together = 128; // pairs: longer messages are added up more slowly
    for (std::size_t pair = 0; pair < pairs_; pair += together)
      MPI_Allreduce(MPI_IN_PLACE, sizes_[pair].data(), bins * to_int(std::min(together, pairs_ - pair)), MPI_DOUBLE,
                    MPI_SUM, comm_);
    std::vector<PairBlock> all;
    for (int rank = 0; rank < to_int(units.size()); ++rank)
    {
      std::vector<PairBlock> part = diagonal_;
      broadcast(part, comm_, rank);
      all.insert(all.end(), part.begin(), part.end());
    }
    diagonal_ = std::move(all);
  }
  for (std::size_t pair = 0; pair < pairs_; ++pair) limits_.push_back(unit_ ? limit_of(pair) : 0);
  sizes_ = {};
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

/// Blocks that are negligible in both pairs' rows are left out, so that no row misses more than its share.
void NearFieldBuilder::collect(const CondensedStrip& strip)
{
  for (std::size_t j = rows_.pair_of(strip.first); j < rows_.pair_of(strip.last); ++j)
  {
    const std::size_t before = kept_.rows.size();
    for (std::size_t i = j; i < pairs_; ++i)
    {
      const PairBlock now = block(strip, i, j);
      if (i != j && !(size_of(now) > 0 && size_of(now) >= std::min(limits_[i], limits_[j]))) continue;
      kept_.rows.push_back(to_int(i));
      for (std::size_t k = 0; k < rows_.per_pair(); ++k)
        for (std::size_t l = 0; l < rows_.per_pair(); ++l) kept_.values.push_back(static_cast<float>(now[k][l]));
    }
    kept_.counts.push_back(to_int(kept_.rows.size() - before));
  }
}

/// The column of a pair completes its rows: what is left of the diagonal has waited, and the rest is this column
/// transposed.
void NearFieldBuilder::keep(const Kept& kept, std::vector<Blocks>& waiting)
{
  const std::size_t n = rows_.per_pair();
  auto row = kept.rows.begin();
  const float* block = kept.values.data();
  for (const int count : kept.counts)
  {
    const std::size_t j = near_rows_.size();
    Blocks own = std::exchange(waiting[j], {});
    for (int k = 0; k < count; ++k, block += n * n)
    {
      const auto i = static_cast<std::size_t>(*row++);
      own.columns.push_back(i);
      for (std::size_t l = 0; l < n; ++l)
        for (std::size_t m = 0; m < n; ++m) own.values.push_back(i == j ? block[l * n + m] : block[m * n + l]);
      if (i == j) continue;
      waiting[i].columns.push_back(j);
      waiting[i].values.insert(waiting[i].values.end(), block, block + n * n);
    }
    near_rows_.push_back(row_of(own));
  }
}

/// The patch of each pair. Pairs that a block of a tenth of their own joins are in one patch; so are patches on which
/// others act half as strongly as they do on themselves, where all are pushed alike. Sweeps patch by patch are expected
/// to converge then, and are watched.
std::vector<std::size_t> NearFieldBuilder::patch_of_pairs() const
{
  DisjointSets neighbours(pairs_);
  for (std::size_t i = 0; i < pairs_; ++i)
    for_each_block(near_rows_[i], i, diagonal_, rows_,
                   [&](std::size_t j, double size)
                   {
                     if (size >= neighbour) neighbours.join(to_int(i), to_int(j));
                   });
  std::vector<std::size_t> first; // pairs of the patches
  for (std::size_t i = 0; i < pairs_; ++i)
    if (neighbours.least(to_int(i)) == to_int(i)) first.push_back(i);
  std::vector<std::size_t> patch_of(pairs_, 0);
  if (first.size() > most_patches) return patch_of;
  for (std::size_t i = 0; i < pairs_; ++i)
  {
    const auto least = static_cast<std::size_t>(neighbours.least(to_int(i)));
    patch_of[i] = static_cast<std::size_t>(std::lower_bound(first.begin(), first.end(), least) - first.begin());
  }
  Eigen::MatrixXd action = Eigen::MatrixXd::Zero(to_int(first.size()), to_int(pairs_)); // of a patch on a pair
  for (std::size_t i = 0; i < pairs_; ++i)
    for_each_block(near_rows_[i], i, diagonal_, rows_,
                   [&](std::size_t j, double size) { action(to_int(patch_of[j]), to_int(i)) += size; });
  for (;;)
  {
    double largest = strong_action;
    std::size_t kept = 0, joined = 0;
    for (std::size_t i = 0; i < pairs_; ++i)
    {
      Eigen::VectorXd others = action.col(to_int(i));
      const double own = std::exchange(others(to_int(patch_of[i])), 0.);
      Eigen::Index strongest = 0;
      if (others.sum() <= largest * own) continue;
      largest = others.sum() / own;
      others.maxCoeff(&strongest);
      kept = std::min(patch_of[i], static_cast<std::size_t>(strongest));
      joined = std::max(patch_of[i], static_cast<std::size_t>(strongest));
    }
    if (kept == joined) return patch_of;
    action.row(to_int(kept)) += action.row(to_int(joined));
    action.row(to_int(joined)).setZero();
    std::replace(patch_of.begin(), patch_of.end(), joined, kept);
  }
}

NearField NearFieldBuilder::finish()
{
  NearField near;
  const auto lists_of = [](Kept& kept, auto work)
  {
    work(kept.counts);
    work(kept.rows);
    work(kept.values);
  };
  if (rank_of(comm_) != 0)
  {
    lists_of(kept_, [&](const auto& list) { send(list, 0, comm_); });
    return near;
  }
  std::vector<Blocks> waiting(pairs_);
  keep(kept_, waiting);
  for (int rank = 1; rank < ranks_of(comm_); ++rank)
  {
    lists_of(kept_, [&](auto& list) { receive(list, rank, comm_); });
    keep(kept_, waiting);
  }
  kept_ = {};
  const std::vector<std::size_t> patch_of = patch_of_pairs();
  near.inside = std::move(near_rows_);
  near.outside.resize(pairs_);
  set_patches(near, patch_of, rows_.per_pair());
  return near;
}

std::size_t NearField::entries() const
{
  std::size_t entries = 0;
  for (const auto* rows : {&inside, &outside})
    for (const PairRow& row : *rows) entries += row.values.size();
  return entries;
}

} // namespace squeal
