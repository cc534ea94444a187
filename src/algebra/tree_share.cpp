#include "tree_share.hpp"

#include "squeal/algebra/panel.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/packed.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace squeal
{

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Supernode, first, columns, below, border, rows_begin, values_begin, children)

namespace
{

/// Gives every rank what rank 0 analysed.
void broadcast_analysis(SymbolicFactor& symbolic, MPI_Comm comm)
{
  std::array<int, 2> sizes{symbolic.dofs, symbolic.border};
  MPI_Bcast(sizes.data(), 2, MPI_INT, 0, comm);
  symbolic.dofs = sizes[0];
  symbolic.border = sizes[1];
  broadcast_packed(symbolic.supernodes, comm);
  broadcast(symbolic.position, comm);
  broadcast(symbolic.rows, comm);
  MPI_Bcast(&symbolic.entries, 1, MPI_DOUBLE, 0, comm);
}

/// Cost of eliminating a supernode [operations], with its part of the Schur complement. An entry costs a thousand
/// operations more, since hundreds of solves read it at the speed of memory.
struct Cost
{
  double inner = 0, border = 0; // of pivots and inner rows, of border rows

  explicit Cost(const Supernode& supernode)
  {
    constexpr double an_entry = 1000;
    const double c = supernode.columns, i = supernode.inner(), b = supernode.border;
    inner = c * c * c / 3 + c * c * i + c * i * i + an_entry * c * (c / 2 + i);
    border = b * c * (c + 2 * i + b + an_entry);
  }
};

/// The owner of each supernode. The costliest subtree is opened, and its root is shared, while that shortens the time
/// of the slowest rank.
std::vector<int> owners_of(const SymbolicFactor& symbolic, int ranks)
{
  const std::size_t count = symbolic.supernodes.size();
  std::vector<double> subtree(count);
  std::vector<char> has_parent(count, 0);
  for (std::size_t k = 0; k < count; ++k)
  {
    const Cost cost(symbolic.supernodes[k]);
    subtree[k] = cost.inner + cost.border;
    for (const int child : symbolic.supernodes[k].children)
    {
      subtree[k] += subtree[at(child)];
      has_parent[at(child)] = 1;
    }
  }
  std::vector<std::size_t> roots; // of subtrees, the costliest first
  const auto insert = [&](std::size_t root)
  {
    const auto costs_more = [&](std::size_t a, std::size_t b) { return subtree[a] > subtree[b]; };
    roots.insert(std::upper_bound(roots.begin(), roots.end(), root, costs_more), root);
  };
  for (std::size_t k = 0; k < count; ++k)
    if (!has_parent[k]) insert(k);
  std::vector<int> owner(count, 0), best;
  double shared = 0, least = std::numeric_limits<double>::infinity();
  for (int opened = 0; !roots.empty() && opened < 50 * ranks; ++opened)
  {
    std::vector<double> load(at(ranks), 0.);
    for (const std::size_t root : roots)
    {
      const auto idle = std::min_element(load.begin(), load.end());
      *idle += subtree[root];
      owner[root] = static_cast<int>(idle - load.begin());
    }
    if (const double longest = shared + *std::max_element(load.begin(), load.end()); longest < least)
    {
      least = longest;
      best = owner;
    }
    const Supernode& opening = symbolic.supernodes[roots.front()];
    const Cost cost(opening);
    shared += cost.inner + cost.border / ranks;
    owner[roots.front()] = everyone;
    roots.erase(roots.begin());
    for (const int child : opening.children) insert(at(child));
  }
  for (std::size_t k = count; k-- > 0;) // parents before children
    for (const int child : symbolic.supernodes[k].children)
      if (best[k] != everyone) best[at(child)] = best[k];
  return best;
}

/// Appends the supernode with those rows of it that `keep` wants; returns its number.
template <class Keep>
std::size_t append(const SymbolicFactor& whole, const Supernode& supernode, Keep keep, SymbolicFactor& share)
{
  Supernode own = supernode;
  own.children.clear();
  own.rows_begin = share.rows.size();
  own.values_begin = share.values;
  own.border = 0;
  for (std::size_t i = 0; i < at(supernode.below); ++i)
  {
    const int row = whole.rows[supernode.rows_begin + i];
    if (!keep(row)) continue;
    share.rows.push_back(row);
    if (row >= whole.dofs) ++own.border;
  }
  own.below = static_cast<int>(share.rows.size() - own.rows_begin);
  share.supernodes.push_back(std::move(own));
  return share.supernodes.size() - 1;
}

} // namespace

int holder_of(int border_row, int ranks)
{
  constexpr int together = 24; // rows: whole tiles of a panel and whole pairs
  return border_row / together % ranks;
}

TreeShare share_tree(SymbolicFactor whole, MPI_Comm comm)
{
  const int ranks = ranks_of(comm), me = rank_of(comm);
  TreeShare share;
  if (ranks == 1)
  {
    share.own = whole.supernodes.size();
    share.symbolic = std::move(whole);
    return share;
  }
  broadcast_analysis(whole, comm);
  const std::vector<int> owner = owners_of(whole, ranks);
  SymbolicFactor& mine = share.symbolic;
  mine.dofs = whole.dofs;
  mine.border = whole.border;
  mine.entries = whole.entries;
  share.owner.resize(at(whole.dofs));
  std::vector<std::size_t> number(whole.supernodes.size(), 0);
  for (std::size_t k = 0; k < whole.supernodes.size(); ++k)
  {
    const Supernode& supernode = whole.supernodes[k];
    std::fill_n(share.owner.begin() + supernode.first, supernode.columns, owner[k]);
    if (owner[k] != me) continue;
    number[k] = append(
        whole, supernode, [](int) { return true; }, mine);
    for (const int child : supernode.children)
      mine.supernodes.back().children.push_back(static_cast<int>(number[at(child)]));
    mine.values += packed_triangle(at(supernode.columns)) + packed_panel(at(supernode.below), at(supernode.columns));
  }
  share.own = mine.supernodes.size();
  for (std::size_t k = 0; k < whole.supernodes.size(); ++k)
  {
    if (owner[k] != everyone) continue;
    const Supernode& supernode = whole.supernodes[k];
    const auto keep = [&](int row) { return row < whole.dofs || holder_of(row - whole.dofs, ranks) == me; };
    number[k] = append(whole, supernode, keep, mine);
    Supernode& kept = mine.supernodes.back();
    const std::size_t columns = at(kept.columns);
    mine.values +=
        packed_triangle(columns) + packed_panel(at(kept.inner()), columns) + packed_panel(at(kept.border), columns);
    const auto rows_of = [&](const Supernode& of)
    { return whole.rows.begin() + static_cast<std::ptrdiff_t>(of.rows_begin); };
    SharedSupernode& shared = share.shared.emplace_back();
    shared.border.assign(rows_of(supernode) + supernode.inner(), rows_of(supernode) + supernode.below);
    for (const int child : supernode.children)
      if (const Supernode& below = whole.supernodes[at(child)]; owner[at(child)] == everyone)
        kept.children.push_back(static_cast<int>(number[at(child)]));
      else
        shared.branches.push_back(
            {owner[at(child)], number[at(child)], at(below.inner()), {rows_of(below), rows_of(below) + below.below}});
  }
  mine.position = std::move(whole.position);
  return share;
}

} // namespace squeal
