/// Products that ranks form together. Of a W whose columns they share: y = sum over ranks of what the lower triangle of
/// their columns and its transpose have in W x. Columns go to ranks by equal parts of the triangle. Of a W in the
/// factor: each rank reads its part of the factor. Whole patches of the near field go to ranks, for sweeps.
#include "gauss_seidel.hpp"
#include "near_field.hpp"
#include "squeal/algebra/large_pages.hpp"
#include "squeal/algebra/panel.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/integers.hpp"
#include "squeal/contact/contact_operator.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr std::size_t worth_sharing = 1000; // rows: reading less takes no longer than two messages

/// The first column of a rank: (1 - column/size)^2 = 1 - rank/ranks, at a whole strip.
std::size_t first_column(std::size_t size, int rank, int ranks)
{
  if (rank == ranks) return size;
  const double part = 1 - std::sqrt(1 - static_cast<double>(rank) / ranks);
  return static_cast<std::size_t>(part * static_cast<double>(size)) / tile * tile;
}

/// The largest patches first, each to the rank that has least.
std::vector<int> owners_by_size(const NearField& near, int ranks)
{
  std::vector<std::size_t> entries, order, load(static_cast<std::size_t>(ranks), 0);
  for (const std::vector<std::size_t>& patch : near.patches)
  {
    order.push_back(order.size());
    entries.push_back(0);
    for (const std::size_t pair : patch) entries.back() += near.inside[pair].values.size();
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return entries[a] > entries[b]; });
  std::vector<int> owners(order.size());
  for (const std::size_t patch : order)
  {
    const auto least = std::min_element(load.begin(), load.end());
    *least += entries[patch];
    owners[patch] = to_int(least - load.begin());
  }
  return owners;
}

template <class Entry> void send(const std::vector<Entry>& entries, int to, MPI_Comm comm)
{
  MPI_Send(entries.data(), to_int(entries.size() * sizeof(Entry)), MPI_BYTE, to, 0, comm);
}

template <class Entry> std::vector<Entry> receive(MPI_Comm comm)
{
  MPI_Status status;
  int bytes = 0;
  MPI_Probe(0, 0, comm, &status);
  MPI_Get_count(&status, MPI_BYTE, &bytes);
  std::vector<Entry> entries(static_cast<std::size_t>(bytes) / sizeof(Entry));
  MPI_Recv(entries.data(), bytes, MPI_BYTE, 0, 0, comm, MPI_STATUS_IGNORE);
  return entries;
}

void send(const NearField::PairRow& row, int to, MPI_Comm comm)
{
  send(row.runs, to, comm);
  send(row.values, to, comm);
}

NearField::PairRow receive_row(MPI_Comm comm)
{
  std::vector<NearField::Run> runs = receive<NearField::Run>(comm);
  return {std::move(runs), receive<float>(comm)};
}

/// Calls work(first, width) for each strip of columns.
template <class Work> void for_each_strip(std::size_t first, std::size_t last, Work work)
{
  for (std::size_t j = first; j < last; j += tile) work(j, std::min(tile, last - j));
}

} // namespace

void ContactOperator::share(MPI_Comm comm)
{
  rows_ = size();
  MPI_Bcast(&rows_, sizeof rows_, MPI_BYTE, 0, comm);
  const int ranks = ranks_of(comm), me = rank_of(comm);
  if (ranks == 1 || rows_ < worth_sharing) return;
  shared_by_ = comm;
  for (int rank = 0; rank < ranks; ++rank)
  {
    Strips strips{first_column(rows_, rank, ranks), first_column(rows_, rank + 1, ranks), {}};
    const auto pass_on = [&](std::size_t j, std::size_t width)
    {
      const std::size_t height = rows_ - j, count = width * height;
      if (me == 0)
      {
        std::vector<double> strip(count);
        for (std::size_t k = 0; k < width; ++k) std::copy_n(&values_[(j + k) * rows_ + j], height, &strip[k * height]);
        MPI_Send(strip.data(), to_int(count), MPI_DOUBLE, rank, 0, comm);
      }
      else
      {
        strips.values.resize(strips.values.size() + count);
        MPI_Recv(strips.values.data() + strips.values.size() - count, to_int(count), MPI_DOUBLE, 0, 0, comm,
                 MPI_STATUS_IGNORE);
      }
    };
    std::size_t total = 0;
    for_each_strip(strips.first, strips.last, [&](std::size_t j, std::size_t width) { total += width * (rows_ - j); });
    if (me == rank && me != 0) strips.values = vector_on_large_pages(total);
    if (rank > 0 && (me == 0 || me == rank)) for_each_strip(strips.first, strips.last, pass_on);
    if (me == rank) strips_ = std::move(strips);
  }
  share_patches();
}

void ContactOperator::share_patches()
{
  const int me = rank_of(shared_by_), ranks = ranks_of(shared_by_);
  std::size_t patches = near_.patches.size();
  MPI_Bcast(&patches, sizeof patches, MPI_BYTE, 0, shared_by_);
  if (patches < 2) return;
  MPI_Bcast(&pairs_, sizeof pairs_, MPI_BYTE, 0, shared_by_);
  MPI_Bcast(&directions_, 1, MPI_INT, 0, shared_by_);
  broadcast(diagonal_, shared_by_);
  broadcast(scale_, shared_by_);
  near_.patches.resize(patches);
  for (std::vector<std::size_t>& patch : near_.patches) broadcast(patch, shared_by_);
  if (me == 0) owners_ = owners_by_size(near_, ranks);
  broadcast(owners_, shared_by_);
  std::vector<int> owner(pairs_); // of pairs
  for (std::size_t patch = 0; patch < patches; ++patch)
    for (const std::size_t pair : near_.patches[patch]) owner[pair] = owners_[patch];
  near_.inside.resize(pairs_); // rank 0 keeps all, for where sweeps patch by patch do not converge
  beyond_.resize(pairs_);
  for (std::size_t pair = 0; pair < pairs_; ++pair)
  {
    if (owner[pair] != 0 && me == 0) send(near_.inside[pair], owner[pair], shared_by_);
    if (owner[pair] != 0 && me == owner[pair]) near_.inside[pair] = receive_row(shared_by_);
    const auto part = [&](int rank)
    {
      return part_of(near_.outside[pair], PairRows<std::size_t>(directions_).per_pair(),
                     [&](std::size_t other) { return owner[other] == rank; });
    };
    for (int rank = 1; me == 0 && rank < ranks; ++rank) send(part(rank), rank, shared_by_);
    beyond_[pair] = me == 0 ? part(0) : receive_row(shared_by_);
  }
}

void ContactOperator::add_strips(std::span<const double> x, std::span<double> y) const
{
  const double* values = strips_.values.data();
  for_each_strip(strips_.first, strips_.last,
                 [&](std::size_t j, std::size_t width)
                 {
                   add_symmetric_product(values, rows_ - j, width, x.data() + j, y.data() + j);
                   values += width * (rows_ - j);
                 });
}

void ContactOperator::multiply_one(std::span<const double> x, std::span<double> y) const
{
  std::fill(y.begin(), y.end(), 0.);
  if (shared_by_ == MPI_COMM_NULL) return add_symmetric_product(values_.data(), size(), size(), x.data(), y.data());
  int task = 1; // a product with one vector
  MPI_Bcast(&task, 1, MPI_INT, 0, shared_by_);
  std::vector<double> from(x.begin(), x.end());
  MPI_Bcast(from.data(), to_int(rows_), MPI_DOUBLE, 0, shared_by_);
  add_symmetric_product(values_.data(), rows_, strips_.last, x.data(), y.data());
  MPI_Reduce(MPI_IN_PLACE, y.data(), to_int(rows_), MPI_DOUBLE, MPI_SUM, 0, shared_by_);
}

/// On rank 0.
std::vector<double> ContactOperator::multiply_by_factor(std::span<const double> x, std::size_t columns) const
{
  int task = to_int(columns);
  if (shared_by_ != MPI_COMM_NULL) MPI_Bcast(&task, 1, MPI_INT, 0, shared_by_);
  std::vector<double> y = products_->products.product(x, columns);
  const std::vector<double>& added = products_->diagonal;
  for (std::size_t i = 0; i < y.size(); ++i)
    y[i] = products_->scale * y[i] + (added.empty() ? 0 : added[i % added.size()] * x[i]);
  return y;
}

void ContactOperator::follow_product(std::size_t columns) const
{
  if (!products_ && lanes_for(columns) > 1) return; // of a whole W rank 0 forms these alone
  int task = 0;
  MPI_Bcast(&task, 1, MPI_INT, 0, shared_by_);
  serve_product(task);
}

void ContactOperator::serve_product(int columns) const
{
  if (products_)
  {
    (void)products_->products.product({}, static_cast<std::size_t>(columns));
    return;
  }
  std::vector<double> x(rows_), y(rows_);
  MPI_Bcast(x.data(), to_int(rows_), MPI_DOUBLE, 0, shared_by_);
  add_strips(x, y);
  MPI_Reduce(y.data(), nullptr, to_int(rows_), MPI_DOUBLE, MPI_SUM, 0, shared_by_);
}

ServedProducts::ServedProducts(const ContactOperator& W) : W_(W)
{
  const MPI_Comm comm = W.shared_by();
  if (comm == MPI_COMM_NULL || rank_of(comm) == 0) return;
  for (;;)
  {
    int task = end_of_service;
    MPI_Bcast(&task, 1, MPI_INT, 0, comm);
    if (task == end_of_service) return;
    if (task == task_of_sweeps)
      sweep_along(W);
    else
      W.serve_product(task);
  }
}

ServedProducts::~ServedProducts()
{
  int task = end_of_service;
  if (W_.shared_by() != MPI_COMM_NULL && rank_of(W_.shared_by()) == 0) MPI_Bcast(&task, 1, MPI_INT, 0, W_.shared_by());
}

} // namespace squeal
