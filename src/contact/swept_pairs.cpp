#include "swept_pairs.hpp"

#include <numeric>

namespace squeal
{

SweptPairs one_patch(const ContactOperator& W)
{
  Turn all;
  all.order.resize(W.pairs());
  std::iota(all.order.begin(), all.order.end(), 0);
  all.own = {{0, W.pairs()}};
  return {{all}};
}

SweptPairs patches_of(const ContactOperator& W)
{
  SweptPairs where;
  where.several = true;
  if (W.shares_patches()) where.comm = W.shared_by();
  const int ranks = where.shared() ? ranks_of(where.comm) : 1, me = where.shared() ? rank_of(where.comm) : 0;
  where.turns.resize(W.patches_take_turns() ? 2 : 1);
  for (std::size_t number = 0; number < where.turns.size(); ++number)
    for (int rank = 0; rank < ranks; ++rank)
    {
      Turn& turn = where.turns[number];
      const std::size_t before = turn.order.size();
      for (std::size_t patch = number; patch < W.patches().size(); patch += where.turns.size())
      {
        if (W.owner(patch) != rank) continue;
        const std::vector<std::size_t>& pairs = W.patches()[patch];
        if (rank == me) turn.own.push_back({turn.order.size(), pairs.size()});
        turn.order.insert(turn.order.end(), pairs.begin(), pairs.end());
      }
      turn.counts.push_back(to_int(turn.order.size() - before));
    }
  return where;
}

} // namespace squeal
