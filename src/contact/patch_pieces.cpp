/// Pieces of a single patch that ranks sweep side by side: all even ones, then all odd ones.
///
/// Each piece is a slice of the patch, so that it touches those next to it, of the other parity. Pieces of one parity
/// see each other's changes when all have been swept (src/README.md, section 4.7), and push each other little.
#include "near_field.hpp"

#include <utility>

namespace squeal
{

namespace
{

// Half a sweep over fewer pairs takes no longer than the messages between pieces.
constexpr std::size_t least_to_divide = 1000; // pairs
constexpr std::size_t least_of_a_piece = 512; // pairs, where there are more pieces than that
constexpr std::size_t fewest_pieces = 4;
constexpr double strong_beside = 0.25; // of pieces that are swept side by side on another, over its own
constexpr double strong_of_two = 0.5;  // the same of two pieces a turn, as of patches

/// The near field of a patch that has all pairs.
struct Patch
{
  const NearField& near;
  const std::vector<PairBlock>& diagonal;
  PairRows<std::size_t> rows;

  std::size_t pairs() const { return near.inside.size(); }
  template <class Take> void for_each_block(std::size_t i, Take take) const
  {
    squeal::for_each_block(near.inside[i], i, diagonal, rows, take);
  }
};

/// All pairs of a patch, from one end of it to the other: by the distance in neighbours from a pair that is as far as
/// any from the first one (George and Liu 1979, pseudo-peripheral node).
std::vector<std::size_t> from_end_to_end(const Patch& patch)
{
  const std::size_t pairs = patch.pairs();
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
      patch.for_each_block(order[next],
                           [&](std::size_t j, double size)
                           {
                             if (size >= neighbour) reach(j);
                           });
    }
  }
  return order;
}

/// The most that other pieces of the same parity push a pair, over its own piece, where all are pushed alike.
double push_beside(const Patch& patch, const std::vector<std::size_t>& piece_of)
{
  double most = 0;
  for (std::size_t i = 0; i < patch.pairs(); ++i)
  {
    double own = 0, beside = 0;
    patch.for_each_block(i,
                         [&](std::size_t j, double size)
                         {
                           if (piece_of[j] == piece_of[i])
                             own += size;
                           else if (piece_of[j] % 2 == piece_of[i] % 2)
                             beside += size;
                         });
    most = std::max(most, beside / own);
  }
  return most;
}

/// The piece of each pair of a single patch: slices from one end of it to the other, as many as may be swept side by
/// side; none where even two a turn push each other too much.
std::vector<std::size_t> pieces_of(const Patch& patch)
{
  const std::size_t pairs = patch.pairs();
  const std::vector<std::size_t> order = from_end_to_end(patch);
  const auto cut = [&](std::size_t pieces)
  {
    std::vector<std::size_t> piece_of(pairs);
    for (std::size_t k = 0; k < pairs; ++k) piece_of[order[k]] = k * pieces / pairs;
    return piece_of;
  };
  std::vector<std::size_t> best = cut(fewest_pieces);
  if (!(push_beside(patch, best) <= strong_of_two)) return {};
  for (std::size_t pieces = 2 * fewest_pieces; pairs / pieces >= least_of_a_piece; pieces *= 2)
  {
    std::vector<std::size_t> finer = cut(pieces);
    if (!(push_beside(patch, finer) <= strong_beside)) break;
    best = std::move(finer);
  }
  return best;
}

} // namespace

void divide_single_patch(NearField& near, const std::vector<PairBlock>& diagonal, const PairRows<std::size_t>& rows)
{
  if (near.patches.size() != 1 || near.inside.size() < least_to_divide) return;
  const std::vector<std::size_t> piece_of = pieces_of({near, diagonal, rows});
  if (piece_of.empty()) return;
  set_patches(near, piece_of, rows.per_pair());
  near.in_turn = true;
}

} // namespace squeal
