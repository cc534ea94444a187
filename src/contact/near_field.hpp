#pragma once
/// The near field of W (contact_operator.hpp), from strips of its columns: once to measure its blocks, and once more to
/// keep those that matter. Each rank may read a range of its columns, the first rank the first one.
#include "squeal/contact/contact_operator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

namespace squeal
{

/// The columns of some pairs.
NearField::PairRow part_of(const NearField::PairRow& row, std::size_t of_a_pair,
                           const std::function<bool(std::size_t pair)>& taken);

/// Sets the patches and the parts of the rows, which are all inside. `of_a_pair`: rows.
void set_patches(NearField& near, const std::vector<std::size_t>& patch_of, std::size_t of_a_pair);

/// Size of a block between neighbours on a mesh, at least; they have 0.2 and more.
inline constexpr double neighbour = 0.1;

/// Calls take(j, size) for each block of pair i's near rows: the largest |W_kl|/sqrt(W_kk W_ll), 1 of its own block.
template <class Take> void for_each_block(const NearField::PairRow& row, std::size_t i,
                                          const std::vector<PairBlock>& diagonal, const PairRows<std::size_t>& rows,
                                          Take take)
{
  const std::size_t n = rows.per_pair();
  const auto part = [&](std::size_t pair, std::size_t k)
  { return diagonal[pair][k][k] > 0 ? 1 / std::sqrt(diagonal[pair][k][k]) : 0; };
  const float* values = row.values.data();
  for (const auto& [first, count] : row.runs)
  {
    for (std::size_t column = 0; column < count; column += n)
    {
      const std::size_t j = rows.pair_of(first + column);
      double size = 0;
      for (std::size_t k = 0; k < n; ++k)
        for (std::size_t l = 0; l < n; ++l)
          size =
              std::max(size, part(i, k) * part(j, l) * std::abs(static_cast<double>(values[k * count + column + l])));
      take(j, size);
    }
    values += n * count;
  }
}

/// Divides a single patch into pieces, those of even and of odd numbers to be swept in turn, if it is large enough for
/// ranks to share the sweeps and the pieces push each other little. `diagonal`: the blocks of W's.
void divide_single_patch(NearField& near, const std::vector<PairBlock>& diagonal, const PairRows<std::size_t>& rows);

/// Strips are of whole pairs and come in the order of their columns.
class NearFieldBuilder
{
public:
  /// `comm`: the ranks that read.
  NearFieldBuilder(std::size_t pairs, int directions, MPI_Comm comm);

  /// Of the first pass.
  void measure(const CondensedStrip& strip);

  /// Ends the first pass. Collective.
  void agree();

  /// Of the second pass.
  void collect(const CondensedStrip& strip);

  /// After the first pass.
  const std::vector<PairBlock>& diagonal() const { return diagonal_; }

  /// After the second pass; moves out what was collected, by patches, on the first rank. Collective.
  NearField finish();

private:
  /// Sums of the sizes of a row's blocks, by eighths of octaves of their size.
  static constexpr int bins = 512;
  using Sizes = std::array<double, bins>;

  /// Blocks in a pair's rows, by rising column.
  struct Blocks
  {
    std::vector<std::size_t> columns{}; // pairs
    std::vector<float> values{};        // block by block, row by row
  };

  /// The blocks of some pairs' columns, from the diagonal on, that matter.
  struct Kept
  {
    std::vector<int> counts{}, rows{}; // blocks of each pair, and the pairs whose rows they are in
    std::vector<float> values{};       // block by block, row by row
  };

  void keep(const Kept& kept, std::vector<Blocks>& waiting);
  NearField::PairRow row_of(const Blocks& blocks) const;
  std::vector<std::size_t> patch_of_pairs() const;

  PairBlock block(const CondensedStrip& strip, std::size_t i, std::size_t j) const;
  int bin_of(double size) const;
  double limit_of(std::size_t pair) const;

  std::size_t pairs_;
  PairRows<std::size_t> rows_;
  MPI_Comm comm_;
  std::optional<int> unit_; // a size, from which bins are counted [eighths of octaves]
  std::vector<Sizes> sizes_;
  std::vector<double> limits_; // sizes of blocks that are left out of a pair's rows
  std::vector<PairBlock> diagonal_;
  Kept kept_; // of this rank
  std::vector<NearField::PairRow> near_rows_;
};

} // namespace squeal
