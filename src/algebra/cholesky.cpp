#include "cholesky.hpp"
#include "front.hpp"
#include "squeal/algebra/panel.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/free_memory.hpp"

#include <algorithm>
#include <memory>
#include <utility>

namespace squeal
{

namespace
{

/// Working memory of an elimination [numbers]. It is allocated once: the system takes as long to clear memory as some
/// fronts take to fill. It is not touched before it is needed.
struct WorkSizes
{
  std::size_t waiting = 0;  // the stack of updates that wait for their parents: children come before these
  std::size_t front = 0;    // the largest one
  std::size_t received = 0; // the largest update of another rank's subtree
};

WorkSizes work_sizes(const SymbolicFactor& symbolic, std::span<const SharedSupernode> shared = {})
{
  WorkSizes sizes;
  std::size_t waiting = 0;
  for (const Supernode& supernode : symbolic.supernodes)
  {
    for (const int child : supernode.children) waiting -= update_size(symbolic.supernodes[at(child)]);
    waiting += update_size(supernode);
    sizes.waiting = std::max(sizes.waiting, waiting);
    sizes.front = std::max(sizes.front, front_size(supernode));
  }
  for (const SharedSupernode& supernode : shared)
    for (const Subtree& branch : supernode.branches)
      sizes.received = std::max(sizes.received, branch.inner * branch.below.size());
  return sizes;
}

double memory_of(const SymbolicFactor& symbolic, const WorkSizes& work)
{
  return sizeof(double) * static_cast<double>(symbolic.values + work.waiting + work.front + work.received) +
         sizeof(int) * static_cast<double>(symbolic.rows.size());
}

/// This rank's entries of its columns and of shared ones. Collective.
Triplets entries_of_columns(const Triplets& own, const TreeShare& share, MPI_Comm comm)
{
  const int ranks = ranks_of(comm);
  std::vector<int> counts(at(ranks), 0), starts(counts.size(), 0), received(counts.size()), places(counts.size(), 0);
  std::vector<int> owners;
  owners.reserve(own.row.size());
  for (std::size_t k = 0; k < own.row.size(); ++k)
    owners.push_back(share.owner[at(place_of(own, k, share.symbolic).second)]);
  const auto for_each_target = [&](std::size_t k, const auto& work)
  {
    const int owner = owners[k];
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

struct Cholesky::Work
{
  explicit Work(const WorkSizes& sizes)
      : waiting(std::make_unique_for_overwrite<double[]>(sizes.waiting)),
        front(std::make_unique_for_overwrite<double[]>(sizes.front)),
        received(std::make_unique_for_overwrite<double[]>(sizes.received)), top(waiting.get())
  {
  }

  std::unique_ptr<double[]> waiting, front, received;
  double* top;                 // of the stack of updates
  std::vector<double*> left{}; // there, the updates of own subtrees' roots
};

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
  Work work(work_sizes(symbolic, share_.shared));
  int failed = !eliminate_own(A, work);
  if (ranks_of(comm_) > 1)
  {
    MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_LOR, comm_);
    if (!failed) failed = !eliminate_shared(A, work);
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

/// Adds to the front what its children left on the stack, the last one first.
void Cholesky::add_children(const Front& front, const std::vector<int>& local, Work& work) const
{
  for (auto number = front.supernode.children.rbegin(); number != front.supernode.children.rend(); ++number)
  {
    const Supernode& child = share_.symbolic.supernodes[at(*number)];
    work.top -= update_size(child);
    add_update(front, {at(child.inner()), {rows_of(child), at(child.below)}, work.top}, local);
  }
}

/// Leaves the updates of the subtrees' roots on the stack.
bool Cholesky::eliminate_own(const Columns& A, Work& work)
{
  const SymbolicFactor& symbolic = share_.symbolic;
  std::vector<int> local(at(symbolic.dofs + symbolic.border));
  work.left.assign(share_.own, nullptr);
  for (std::size_t k = 0; k < share_.own; ++k)
  {
    const Supernode& supernode = symbolic.supernodes[k];
    const Front front{supernode, rows_of(supernode), work.front.get()};
    assemble(front, A, local);
    add_children(front, local, work);
    if (!eliminate_pivots(front)) return false;
    pack(supernode, front.values, at(supernode.below));
    copy_update(front, work.top);
    work.left[k] = work.top;
    work.top += update_size(supernode);
  }
  return true;
}

/// Continues where a pivot is not positive, since all ranks take part.
bool Cholesky::eliminate_shared(const Columns& A, Work& work)
{
  const SymbolicFactor& symbolic = share_.symbolic;
  const int ranks = ranks_of(comm_), me = rank_of(comm_);
  std::vector<int> local(at(symbolic.dofs + symbolic.border), -1);
  bool positive = true;
  for (std::size_t k = 0; k < share_.shared.size(); ++k)
  {
    const Supernode& supernode = symbolic.supernodes[share_.own + k];
    const SharedSupernode& shared = share_.shared[k];
    const Front front{supernode, rows_of(supernode), work.front.get()};
    for (const int row : shared.border)
      if (holder_of(row - symbolic.dofs, ranks) != me) local[at(row)] = -1;
    assemble(front, A, local);
    for (const Subtree& branch : shared.branches)
    {
      double* const update = branch.owner == me ? work.left[branch.root] : work.received.get();
      MPI_Bcast(update, to_int(branch.inner * branch.below.size()), MPI_DOUBLE, branch.owner, comm_);
      add_update(front, {branch.inner, branch.below, update}, local);
    }
    add_children(front, local, work);
    positive = eliminate_pivots(front) && positive;
    pack(supernode, front.values, at(supernode.inner()));
    copy_update(front, work.top);
    work.top += update_size(supernode);
  }
  return positive;
}

double cholesky_memory(const SymbolicFactor& symbolic)
{
  return memory_of(symbolic, work_sizes(symbolic));
}

double cholesky_memory(const TreeShare& share)
{
  return memory_of(share.symbolic, work_sizes(share.symbolic, share.shared));
}

// The two halves of a solve with the Cholesky factor.

namespace
{

/// The triangle of a supernode and the panels below it.
struct Packed
{
  const double* triangle;
  Panel inner, border;
};

/// Supernode k in the packed factor. Of shared supernodes both panels follow each other; of others `inner` holds all
/// rows below.
Packed packed_supernode(const TreeShare& share, std::size_t k, const std::vector<double>& values)
{
  const Supernode& supernode = share.symbolic.supernodes[k];
  const std::size_t pivots = at(supernode.columns), below = at(supernode.below);
  const std::size_t rows = k >= share.own ? at(supernode.inner()) : below;
  Packed packed{&values[supernode.values_begin], {}, {}};
  packed.inner = {packed.triangle + packed_triangle(pivots), rows, pivots};
  packed.border = {packed.inner.values + packed_panel(rows, pivots), below - rows, pivots};
  return packed;
}

/// x at the rows -= L times the pivots' own entries.
void subtract_below(const Panel& L, const int* rows, std::size_t lanes, const double* own, double* x,
                    std::vector<double>& part)
{
  part.assign((L.rows + tile) * lanes, 0.);
  subtract_product(L, lanes, own, part.data());
  for (std::size_t i = 0; i < L.rows; ++i)
    for (std::size_t l = 0; l < lanes; ++l) x[at(rows[i]) * lanes + l] += part[i * lanes + l];
}

/// own -= L' times x at the rows.
void subtract_above(const Panel& L, const int* rows, std::size_t lanes, const double* x, double* own,
                    std::vector<double>& part)
{
  part.assign((L.rows + tile) * lanes, 0.);
  for (std::size_t i = 0; i < L.rows; ++i)
    for (std::size_t l = 0; l < lanes; ++l) part[i * lanes + l] = x[at(rows[i]) * lanes + l];
  subtract_transposed(L, lanes, part.data(), own);
}

} // namespace

PositionExchange::PositionExchange(const RowLayout& layout, const std::vector<int>& position,
                                   const std::vector<int>& owner, MPI_Comm comm)
{
  const int ranks = ranks_of(comm), me = rank_of(comm);
  std::vector<PetscSFNode> from;
  for (int rank = 0; rank < ranks; ++rank)
    for (int i = 0; i < layout.counts[static_cast<std::size_t>(rank)]; ++i)
    {
      const int row = layout.starts[static_cast<std::size_t>(rank)] + i;
      const auto place = static_cast<std::size_t>(position[static_cast<std::size_t>(row)]);
      const int target = owner.empty() || owner[place] < 0 ? rank : owner[place];
      if (target != me) continue;
      positions_.push_back(place);
      from.push_back({rank, i});
    }
  check(PetscSFCreate(comm, rows_.put()));
  check(PetscSFSetGraph(rows_, layout.counts[static_cast<std::size_t>(me)], static_cast<PetscInt>(from.size()), nullptr,
                        PETSC_COPY_VALUES, from.data(), PETSC_COPY_VALUES));
}

void PositionExchange::gather(std::span<const double* const> b, std::size_t lanes, std::vector<double>& x) const
{
  std::vector<double> in(positions_.size());
  for (std::size_t k = 0; k < b.size(); ++k)
  {
    check(PetscSFBcastBegin(rows_, MPI_DOUBLE, b[k], in.data(), MPI_REPLACE));
    check(PetscSFBcastEnd(rows_, MPI_DOUBLE, b[k], in.data(), MPI_REPLACE));
    for (std::size_t i = 0; i < in.size(); ++i) x[positions_[i] * lanes + k] = in[i];
  }
}

void PositionExchange::scatter(const std::vector<double>& x, std::size_t lanes, std::span<double* const> b) const
{
  std::vector<double> out(positions_.size());
  for (std::size_t k = 0; k < b.size(); ++k)
  {
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = x[positions_[i] * lanes + k];
    check(PetscSFReduceBegin(rows_, MPI_DOUBLE, out.data(), b[k], MPI_REPLACE));
    check(PetscSFReduceEnd(rows_, MPI_DOUBLE, out.data(), b[k], MPI_REPLACE));
  }
}

std::vector<double> Cholesky::forward(std::span<const double* const> b)
{
  const SymbolicFactor& symbolic = share_.symbolic;
  columns_ = b.size();
  lanes_ = lanes_for(columns_);
  const std::size_t dofs = at(symbolic.dofs), border = at(symbolic.border);
  work_.assign((dofs + border + tile) * lanes_, 0.);
  exchange_.gather(b, lanes_, work_);
  double* const x = work_.data();
  std::vector<double> part;
  for (std::size_t k = 0; k < symbolic.supernodes.size(); ++k)
  {
    const Supernode& supernode = symbolic.supernodes[k];
    const Packed packed = packed_supernode(share_, k, values_);
    double* const own = x + at(supernode.first) * lanes_;
    if (k == share_.own) sum_shared_pivots();
    solve_triangle(packed.triangle, at(supernode.columns), lanes_, own);
    subtract_below(packed.inner, rows_of(supernode), lanes_, own, x, part);
    if (packed.border.rows > 0)
      subtract_below(packed.border, rows_of(supernode) + supernode.inner(), lanes_, own, x, part);
  }
  std::vector<double> result(border * columns_);
  for (std::size_t i = 0; i < border; ++i)
    for (std::size_t k = 0; k < columns_; ++k) result[k * border + i] = -x[(dofs + i) * lanes_ + k];
  if (ranks_of(comm_) == 1) return result;
  const bool first = rank_of(comm_) == 0;
  MPI_Reduce(first ? MPI_IN_PLACE : result.data(), result.data(), to_int(result.size()), MPI_DOUBLE, MPI_SUM, 0, comm_);
  if (!first) result.clear();
  return result;
}

/// Adds up what the ranks have at the pivots of shared supernodes.
void Cholesky::sum_shared_pivots()
{
  std::vector<double> sum;
  const auto shared = std::span(share_.symbolic.supernodes).subspan(share_.own);
  const auto begin_of = [&](const Supernode& supernode)
  { return work_.begin() + static_cast<std::ptrdiff_t>(at(supernode.first) * lanes_); };
  const auto size_of = [&](const Supernode& supernode) { return at(supernode.columns) * lanes_; };
  for (const Supernode& supernode : shared)
    sum.insert(sum.end(), begin_of(supernode), begin_of(supernode) + static_cast<std::ptrdiff_t>(size_of(supernode)));
  MPI_Allreduce(MPI_IN_PLACE, sum.data(), to_int(sum.size()), MPI_DOUBLE, MPI_SUM, comm_);
  const double* from = sum.data();
  for (const Supernode& supernode : shared)
  {
    std::copy_n(from, size_of(supernode), begin_of(supernode));
    from += size_of(supernode);
  }
}

/// Subtracts E' lambda of all ranks from the pivots of shared supernodes.
void Cholesky::subtract_shared_border()
{
  std::vector<double> sum, part;
  const auto shared = std::span(share_.symbolic.supernodes).subspan(share_.own);
  const auto size_of = [&](const Supernode& supernode) { return at(supernode.columns) * lanes_; };
  for (std::size_t k = 0; k < shared.size(); ++k)
  {
    const std::size_t size = size_of(shared[k]);
    sum.resize(sum.size() + size, 0.);
    subtract_above(packed_supernode(share_, share_.own + k, values_).border, rows_of(shared[k]) + shared[k].inner(),
                   lanes_, work_.data(), sum.data() + sum.size() - size, part);
  }
  MPI_Allreduce(MPI_IN_PLACE, sum.data(), to_int(sum.size()), MPI_DOUBLE, MPI_SUM, comm_);
  const double* from = sum.data();
  for (const Supernode& supernode : shared)
    for (std::size_t i = 0; i < size_of(supernode); ++i) work_[at(supernode.first) * lanes_ + i] += *from++;
}

void Cholesky::backward(const std::vector<double>& lambda, std::span<double* const> x)
{
  const SymbolicFactor& symbolic = share_.symbolic;
  const std::size_t dofs = at(symbolic.dofs), border = at(symbolic.border);
  std::vector<double> forces = lambda;
  broadcast(forces, comm_);
  for (std::size_t i = 0; i < border; ++i)
    for (std::size_t k = 0; k < columns_; ++k) work_[(dofs + i) * lanes_ + k] = forces[k * border + i];
  if (share_.own < symbolic.supernodes.size()) subtract_shared_border();
  std::vector<double> part;
  for (std::size_t k = symbolic.supernodes.size(); k-- > 0;)
  {
    const Supernode& supernode = symbolic.supernodes[k];
    const Packed packed = packed_supernode(share_, k, values_);
    double* const own = work_.data() + at(supernode.first) * lanes_;
    subtract_above(packed.inner, rows_of(supernode), lanes_, work_.data(), own, part);
    solve_transposed_triangle(packed.triangle, at(supernode.columns), lanes_, own);
  }
  exchange_.scatter(work_, lanes_, x);
}

} // namespace squeal
