#include "cholesky.hpp"

#include "front.hpp"
#include "squeal/algebra/large_pages.hpp"
#include "squeal/algebra/panel.hpp"
#include "squeal/base/integers.hpp"

#include <algorithm>
#include <memory>
#include <utility>

namespace squeal
{

namespace
{

/// The largest sizes of the stack of updates that wait for their parents, and of a front, of supernodes from `begin` to
/// `end`.
std::pair<std::size_t, std::size_t> largest_sizes(const SymbolicFactor& symbolic, std::size_t begin, std::size_t end)
{
  std::size_t waiting = 0, most = 0, front = 0;
  for (std::size_t k = begin; k < end; ++k)
  {
    const Supernode& supernode = symbolic.supernodes[k];
    for (const int child : supernode.children) waiting -= update_size(symbolic.supernodes[at(child)]);
    waiting += update_size(supernode);
    most = std::max(most, waiting);
    front = std::max(front, front_size(supernode));
  }
  return {most, front};
}

/// This rank's entries of its columns and of shared ones. Collective.
Triplets entries_of_columns(const Triplets& own, const TreeShare& share, MPI_Comm comm)
{
  const int ranks = ranks_of(comm);
  std::vector<int> counts(at(ranks), 0), starts(counts.size(), 0), received(counts.size()), places(counts.size(), 0);
  const auto for_each_target = [&](std::size_t k, const auto& work)
  {
    const int owner = share.owner[at(place_of(own, k, share.symbolic).second)];
    for (int rank = owner == everyone ? 0 : owner; rank < (owner == everyone ? ranks : owner + 1); ++rank)
      work(at(rank));
  };
  for (std::size_t k = 0; k < own.row.size(); ++k) for_each_target(k, [&](std::size_t rank) { ++counts[rank]; });
  MPI_Alltoall(counts.data(), 1, MPI_INT, received.data(), 1, MPI_INT, comm);
  for (std::size_t p = 1; p < counts.size(); ++p)
  {
    starts[p] = starts[p - 1] + counts[p - 1];
    places[p] = places[p - 1] + received[p - 1];
  }
  const auto exchange = [&](const auto& from, auto& to, MPI_Datatype type)
  {
    std::remove_cvref_t<decltype(to)> out(at(starts.back() + counts.back()));
    to.resize(at(places.back() + received.back()));
    std::vector<int> next = starts;
    for (std::size_t k = 0; k < from.size(); ++k)
      for_each_target(k, [&](std::size_t rank) { out[at(next[rank]++)] = from[k]; });
    MPI_Alltoallv(out.data(), counts.data(), starts.data(), type, to.data(), received.data(), places.data(), type,
                  comm);
  };
  Triplets result;
  exchange(own.row, result.row, MPI_INT);
  exchange(own.column, result.column, MPI_INT);
  exchange(own.value, result.value, MPI_DOUBLE);
  return result;
}

} // namespace

Cholesky::Cholesky(Triplets own, SymbolicFactor symbolic, const RowLayout& layout, MPI_Comm comm)
    : comm_(comm), share_(share_tree(std::move(symbolic), comm)),
      exchange_(layout, share_.symbolic.position, share_.owner, comm)
{
  if (ranks_of(comm) > 1) own = entries_of_columns(own, share_, comm);
  factorise(std::move(own));
}

void Cholesky::factorise(Triplets own)
{
  const SymbolicFactor& symbolic = share_.symbolic;
  const Columns A = ordered(own, symbolic);
  own = {};
  values_ = vector_on_large_pages(symbolic.values);
  // Updates form a stack, since children come before parents. Its memory is not touched before it is needed.
  const auto waiting = std::make_unique_for_overwrite<double[]>(largest_sizes(symbolic, 0, share_.own).first);
  int failed = !eliminate_own(A, waiting.get());
  if (ranks_of(comm_) > 1)
  {
    MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_LOR, comm_);
    if (!failed) failed = !eliminate_shared(A);
    MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_LOR, comm_);
  }
  failed_ = failed;
}

/// Packs the pivots of a front into the factor, with the rows below as one panel, or as two, split before row `split`.
void Cholesky::pack(const Supernode& supernode, const double* front, std::size_t split)
{
  const std::size_t pivots = at(supernode.columns), below = at(supernode.below), height = pivots + below;
  values_.resize(supernode.values_begin + packed_triangle(pivots) + packed_panel(split, pivots) +
                 packed_panel(below - split, pivots));
  double* to = pack_triangle(front, height, pivots, &values_[supernode.values_begin]);
  to = pack_panel(front + pivots, height, split, pivots, to);
  pack_panel(front + pivots + split, height, below - split, pivots, to);
}

/// Leaves the updates of the subtrees' roots in `waiting`.
bool Cholesky::eliminate_own(const Columns& A, double* waiting)
{
  const SymbolicFactor& symbolic = share_.symbolic;
  const auto values = std::make_unique_for_overwrite<double[]>(largest_sizes(symbolic, 0, share_.own).second);
  std::vector<int> local(at(symbolic.dofs + symbolic.border));
  left_.assign(share_.own, nullptr);
  double* top = waiting;
  for (std::size_t k = 0; k < share_.own; ++k)
  {
    const Supernode& supernode = symbolic.supernodes[k];
    const Front front{supernode, rows_of(supernode), values.get()};
    assemble(front, A, local);
    for (auto number = supernode.children.rbegin(); number != supernode.children.rend(); ++number)
    {
      const Supernode& child = symbolic.supernodes[at(*number)];
      top -= update_size(child);
      add_update(front, {at(child.inner()), {rows_of(child), at(child.below)}, top}, local);
    }
    if (!eliminate_pivots(front)) return false;
    pack(supernode, front.values, at(supernode.below));
    copy_update(front, top);
    left_[k] = top;
    top += update_size(supernode);
  }
  return true;
}

/// Continues where a pivot is not positive, since all ranks take part.
bool Cholesky::eliminate_shared(const Columns& A)
{
  const SymbolicFactor& symbolic = share_.symbolic;
  const int ranks = ranks_of(comm_), me = rank_of(comm_);
  std::vector<int> local(at(symbolic.dofs + symbolic.border), -1);
  updates_.resize(share_.shared.size());
  std::vector<double> values, received;
  bool positive = true;
  for (std::size_t k = 0; k < share_.shared.size(); ++k)
  {
    const Supernode& supernode = symbolic.supernodes[share_.own + k];
    const SharedSupernode& shared = share_.shared[k];
    values.resize(std::max(values.size(), front_size(supernode)));
    const Front front{supernode, rows_of(supernode), values.data()};
    for (const int row : shared.border)
      if (holder_of(row - symbolic.dofs, ranks) != me) local[at(row)] = -1;
    assemble(front, A, local);
    for (const Subtree& branch : shared.branches)
    {
      const std::size_t size = branch.inner * branch.below.size();
      received.resize(std::max(received.size(), size));
      if (branch.owner == me) std::copy_n(left_[branch.root], size, received.data());
      MPI_Bcast(received.data(), to_int(size), MPI_DOUBLE, branch.owner, comm_);
      add_update(front, {branch.inner, branch.below, received.data()}, local);
    }
    for (const int number : supernode.children)
    {
      const Supernode& child = symbolic.supernodes[at(number)];
      std::vector<double>& update = updates_[at(number) - share_.own];
      add_update(front, {at(child.inner()), {rows_of(child), at(child.below)}, update.data()}, local);
      update = {};
    }
    positive = eliminate_pivots(front) && positive;
    pack(supernode, front.values, at(supernode.inner()));
    updates_[k].resize(update_size(supernode));
    copy_update(front, updates_[k].data());
  }
  updates_.clear();
  left_.clear();
  return positive;
}

double cholesky_memory(const SymbolicFactor& symbolic)
{
  const auto [waiting, front] = largest_sizes(symbolic, 0, symbolic.supernodes.size());
  return sizeof(double) * static_cast<double>(symbolic.values + waiting + front) +
         sizeof(int) * static_cast<double>(symbolic.rows.size());
}

double cholesky_memory(const TreeShare& share)
{
  const SymbolicFactor& symbolic = share.symbolic;
  const auto [own, front] = largest_sizes(symbolic, 0, share.own);
  const auto [shared, shared_front] = largest_sizes(symbolic, share.own, symbolic.supernodes.size());
  return sizeof(double) * static_cast<double>(symbolic.values + own + shared + std::max(front, shared_front)) +
         sizeof(int) * static_cast<double>(symbolic.rows.size());
}

} // namespace squeal
