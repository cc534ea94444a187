/// Blocks are measured by their largest entries, and every rank has the sizes of all of them. Each rank sweeps over two
/// slices of the pairs: all first slices side by side, then all second ones. A slice touches those next to it, of the
/// other turn (src/README.md, section 4.7).
#include "near_field.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/dense.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

using Sizes = Eigen::MatrixXf; // pairs x pairs

constexpr double neighbour = 0.1;     // size of a block between neighbours, at least; they have 0.2 and more
constexpr double strong_beside = 0.5; // push of the other slices of a turn, over the own one's

Index to_index(std::size_t number)
{
  return static_cast<Index>(number);
}

double size_of(const PairBlock& block)
{
  double size = 0;
  for (const PairVector& row : block)
    for (const double entry : row) size = std::max(size, std::abs(entry));
  return std::isfinite(size) ? size : 0;
}

/// Collective.
Sizes block_sizes(const CondensedStrip& own, std::size_t pairs, const PairRows<std::size_t>& rows, MPI_Comm comm)
{
  Sizes sizes = Sizes::Zero(to_index(pairs), to_index(pairs));
  for (std::size_t j = rows.pair_of(own.first); j < rows.pair_of(own.last); ++j)
    for (std::size_t i = j; i < pairs; ++i)
      sizes(to_index(i), to_index(j)) = sizes(to_index(j), to_index(i)) =
          static_cast<float>(size_of(block_of(own, rows, i, j)));
  for (Index j = 0; j < sizes.cols(); ++j)
    MPI_Allreduce(MPI_IN_PLACE, sizes.col(j).data(), to_int(pairs), MPI_FLOAT, MPI_SUM, comm);
  return sizes;
}

/// Sizes relative to both pairs' own blocks.
double relative_size(const Sizes& sizes, std::size_t i, std::size_t j)
{
  const Index a = to_index(i), b = to_index(j);
  const double own = static_cast<double>(sizes(a, a)) * static_cast<double>(sizes(b, b));
  return own > 0 ? static_cast<double>(sizes(a, b)) / std::sqrt(own) : 0;
}

/// For each pair the size below which the blocks of its rows add up to ContactOperator::left_out of its own block.
std::vector<float> limits_of(const Sizes& sizes)
{
  std::vector<float> limits;
  for (Index i = 0; i < sizes.cols(); ++i)
  {
    Eigen::VectorXf row = sizes.col(i);
    std::sort(row.begin(), row.end());
    double sum = 0;
    const auto first = std::find_if(
        row.begin(), row.end() - 1,
        [&](float size)
        { return (sum += static_cast<double>(size)) > ContactOperator::left_out * static_cast<double>(sizes(i, i)); });
    limits.push_back(*first);
  }
  return limits;
}

/// All pairs from one end to the other, by the distance in neighbours from a pseudo-peripheral one. That is as far as
/// any from the first (George and Liu 1979).
std::vector<std::size_t> from_end_to_end(const Sizes& sizes)
{
  const auto pairs = static_cast<std::size_t>(sizes.cols());
  std::vector<std::size_t> order;
  for (std::size_t start = 0, passage = 0; passage < 2; start = order.back(), ++passage)
  {
    std::vector<char> reached(pairs, 0);
    order.clear();
    const auto reach = [&](std::size_t pair)
    {
      if (!std::exchange(reached[pair], 1)) order.push_back(pair);
    };
    reach(start);
    for (std::size_t next = 0, unseen = 0; next < pairs; ++next)
    {
      for (; next == order.size(); ++unseen) reach(unseen); // of those that no neighbour leads to
      for (std::size_t j = 0; j < pairs; ++j)
        if (relative_size(sizes, order[next], j) >= neighbour) reach(j);
    }
  }
  return order;
}

/// The most that other slices of the same turn push a pair, over its own slice, where all are pushed alike.
double push_beside(const Sizes& sizes, const std::vector<std::size_t>& order, std::size_t slices)
{
  std::vector<std::size_t> slice(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) slice[order[k]] = k * slices / order.size();
  double most = 0;
  for (std::size_t i = 0; i < order.size(); ++i)
  {
    double own = 0, beside = 0;
    for (std::size_t j = 0; j < order.size(); ++j)
      if (slice[j] == slice[i])
        own += relative_size(sizes, i, j);
      else if (slice[j] % 2 == slice[i] % 2)
        beside += relative_size(sizes, i, j);
    most = std::max(most, beside / own);
  }
  return most;
}

/// The first place of each rank among the pairs, and the end: as many ranks as may sweep side by side have some.
std::vector<std::size_t> places_of_ranks(const Sizes& sizes, const std::vector<std::size_t>& order, MPI_Comm comm)
{
  const auto ranks = static_cast<std::size_t>(ranks_of(comm));
  std::size_t sweeping = std::clamp<std::size_t>(order.size() / static_cast<std::size_t>(pairs_per_exchange), 1, ranks);
  while (sweeping > 1 && !(push_beside(sizes, order, 2 * sweeping) <= strong_beside)) sweeping /= 2;
  std::vector<std::size_t> places;
  for (std::size_t rank = 0; rank <= ranks; ++rank)
    places.push_back((std::min(rank, sweeping) * order.size() + sweeping - 1) / sweeping);
  return places;
}

/// Blocks that are negligible in both pairs' rows are left out, so that no row misses more than its share.
struct Kept
{
  const Sizes& sizes;
  std::vector<float> limits = limits_of(sizes);

  bool operator()(std::size_t i, std::size_t j) const
  {
    const float size = sizes(to_index(i), to_index(j));
    return i == j || (size > 0 && size >= std::min(limits[i], limits[j]));
  }
};

/// The places of the blocks that are kept in the rows of a pair, in the columns of own pairs.
NearRow empty_row(std::size_t i, const Kept& is_kept, const std::vector<char>& is_own, std::size_t of_a_pair)
{
  NearRow row;
  std::size_t begin = 0;
  for (std::size_t j = 0; j < is_own.size(); ++j)
  {
    if (!is_own[j] || !is_kept(i, j)) continue;
    if (row.runs.empty() || row.runs.back().first + row.runs.back().count != j * of_a_pair)
      row.runs.push_back({j * of_a_pair, 0, begin});
    row.runs.back().count += of_a_pair;
    begin += of_a_pair * of_a_pair;
  }
  row.values.resize(begin);
  return row;
}

/// Sets the block in the columns of pair j; entry(k, l): of the rows.
template <class Entry> void set_block(NearRow& row, std::size_t j, std::size_t of_a_pair, Entry entry)
{
  const auto after = std::upper_bound(row.runs.begin(), row.runs.end(), j * of_a_pair,
                                      [](std::size_t column, const NearRow::Run& run) { return column < run.first; });
  const NearRow::Run& run = *(after - 1);
  for (std::size_t k = 0; k < of_a_pair; ++k)
    for (std::size_t l = 0; l < of_a_pair; ++l)
      row.values[run.begin + k * run.count + j * of_a_pair - run.first + l] = entry(k, l);
}

} // namespace

PairBlock block_of(const CondensedStrip& columns, const PairRows<std::size_t>& rows, std::size_t i, std::size_t j)
{
  PairBlock result{};
  for (std::size_t k = 0; k < rows.per_pair(); ++k)
    for (std::size_t l = 0; l < rows.per_pair(); ++l)
    {
      const std::size_t row = rows.normal(i) + k, column = rows.normal(j) + l;
      result[k][l] = row >= column ? columns.entry(row, column) : columns.entry(column, row);
    }
  return result;
}

NearField make_near_field(const CondensedStrip& own, std::size_t pairs, int directions, MPI_Comm comm)
{
  const PairRows<std::size_t> rows(directions);
  const std::size_t n = rows.per_pair();
  const Sizes sizes = block_sizes(own, pairs, rows, comm);
  const Kept is_kept{sizes};
  NearField near;
  near.order = ranks_of(comm) > 1 ? from_end_to_end(sizes) : all_pairs(pairs).order;
  near.of_ranks = places_of_ranks(sizes, near.order, comm);
  std::vector<char> is_own(pairs, 0);
  const auto me = static_cast<std::size_t>(rank_of(comm));
  for (std::size_t k = near.of_ranks[me]; k < near.of_ranks[me + 1]; ++k) is_own[near.order[k]] = 1;
  for (std::size_t i = 0; i < pairs; ++i) near.rows.push_back(empty_row(i, is_kept, is_own, n));
  const std::vector<std::size_t> shares = column_shares(rows.rows_of(pairs), comm);
  for (std::size_t rank = 0; rank + 1 < shares.size(); ++rank) // each gives the blocks of its columns
  {
    const auto for_each_block = [&](const auto& work)
    {
      for (std::size_t j = rows.pair_of(shares[rank]); j < rows.pair_of(shares[rank + 1]); ++j)
        for (std::size_t i = j; i < pairs; ++i)
          if (is_kept(i, j)) work(i, j);
    };
    std::vector<float> values;
    if (rank == me)
      for_each_block(
          [&](std::size_t i, std::size_t j)
          {
            const PairBlock block = block_of(own, rows, i, j);
            for (std::size_t k = 0; k < n; ++k)
              for (std::size_t l = 0; l < n; ++l) values.push_back(static_cast<float>(block[k][l]));
          });
    broadcast(values, comm, to_int(rank));
    const float* block = values.data();
    for_each_block(
        [&](std::size_t i, std::size_t j)
        {
          if (is_own[j]) set_block(near.rows[i], j, n, [&](std::size_t k, std::size_t l) { return block[k * n + l]; });
          if (is_own[i] && i != j)
            set_block(near.rows[j], i, n, [&](std::size_t k, std::size_t l) { return block[l * n + k]; });
          block += n * n;
        });
  }
  return near;
}

} // namespace squeal
