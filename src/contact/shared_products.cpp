/// Products that ranks form together. Of a W whose columns they share: y = sum over ranks of what the lower triangle of
/// their columns and its transpose have in W x. Columns go to ranks by equal parts of the triangle. Of a W in the
/// factor: each rank reads its part of the factor. Whole patches of the near field go to ranks, for sweeps.
#include "gauss_seidel.hpp"
#include "near_field.hpp"
#include "squeal/algebra/panel.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/free_memory.hpp"
#include "squeal/contact/contact_operator.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

constexpr std::size_t strip_width = CondensedProducts::together; // columns

/// The first column of a rank: (1 - column/rows)^2 = 1 - rank/ranks, at a whole strip.
std::size_t first_column(std::size_t rows, int rank, int ranks)
{
  if (rank == ranks) return rows;
  const double part = 1 - std::sqrt(1 - static_cast<double>(rank) / ranks);
  return static_cast<std::size_t>(part * static_cast<double>(rows)) / strip_width * strip_width;
}

/// Pieces that are swept side by side are of one size: neighbours to each rank.
std::vector<int> owners_of_pieces(std::size_t pieces, int ranks)
{
  std::vector<int> owners;
  for (std::size_t piece = 0; piece < pieces; ++piece)
    owners.push_back(to_int(piece / 2 * static_cast<std::size_t>(ranks) / ((pieces + 1) / 2)));
  return owners;
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

void send_row(const NearField::PairRow& row, int to, MPI_Comm comm)
{
  send(row.runs, to, comm);
  send(row.values, to, comm);
}

NearField::PairRow receive_row(MPI_Comm comm)
{
  NearField::PairRow row;
  receive(row.runs, 0, comm);
  receive(row.values, 0, comm);
  return row;
}

/// Columns of the lower triangle of a W by rows, from the first one's row on.
std::vector<double> columns_of(const std::vector<double>& W, std::size_t rows, std::size_t first, std::size_t last)
{
  const std::size_t height = rows - first;
  std::vector<double> columns((last - first) * height);
  for (std::size_t j = first; j < last; ++j) std::copy_n(&W[j * rows + first], height, &columns[(j - first) * height]);
  return columns;
}

} // namespace

bool is_worth_sharing(double rows, int ranks)
{
  return ranks > 1 && rows >= 1000;
}

namespace
{

/// Calls work(first, last) for the columns of each strip.
template <class Work> void for_each_strip_of(std::size_t first, std::size_t last, Work work)
{
  for (; first < last; first += strip_width) work(first, std::min(first + strip_width, last));
}

} // namespace

void ContactOperator::for_each_strip(const std::function<void(const CondensedStrip&)>& work) const
{
  std::size_t before = 0; // numbers
  for_each_strip_of(strips_.first, strips_.last,
                    [&](std::size_t first, std::size_t last)
                    {
                      work({first, last, rows_ - first, strips_.values.data() + before});
                      before += (last - first) * (rows_ - first);
                    });
}

/// Makes place for this rank's strips; returns the first column of each rank, and the end.
std::vector<std::size_t> ContactOperator::share_columns(std::size_t rows, MPI_Comm comm)
{
  const int ranks = ranks_of(comm), me = rank_of(comm);
  std::vector<std::size_t> firsts;
  for (int rank = 0; rank <= ranks; ++rank) firsts.push_back(first_column(rows, rank, ranks));
  shared_by_ = comm;
  rows_ = rows;
  const auto own = firsts.begin() + me;
  std::size_t total = 0;
  for_each_strip_of(own[0], own[1],
                    [&](std::size_t first, std::size_t last) { total += (last - first) * (rows - first); });
  strips_ = {own[0], own[1], vector_on_large_pages(total)};
  return firsts;
}

/// Appends columns of this rank, of whole strips unless they are its last ones.
void ContactOperator::append_strips(const CondensedStrip& columns)
{
  for_each_strip_of(columns.first, columns.last,
                    [&](std::size_t first, std::size_t last)
                    {
                      for (std::size_t j = first; j < last; ++j)
                      {
                        const double* const from =
                            columns.values + (j - columns.first) * columns.height + (first - columns.first);
                        strips_.values.insert(strips_.values.end(), from, from + (rows_ - first));
                      }
                    });
}

void ContactOperator::share(MPI_Comm comm)
{
  std::size_t rows = size();
  MPI_Bcast(&rows, sizeof rows, MPI_BYTE, 0, comm);
  if (!is_worth_sharing(static_cast<double>(rows), ranks_of(comm))) return;
  const std::vector<std::size_t> firsts = share_columns(rows, comm);
  const int me = rank_of(comm);
  for (int rank = 0; rank < ranks_of(comm); ++rank)
  {
    const auto own = firsts.begin() + rank;
    for_each_strip_of(own[0], own[1],
                      [&](std::size_t first, std::size_t last)
                      {
                        std::vector<double> columns;
                        if (me == 0) columns = columns_of(values_, rows, first, last);
                        if (me == 0 && rank != 0) send(columns, rank, comm);
                        if (me != 0 && rank == me) receive(columns, 0, comm);
                        if (rank == me) append_strips({first, last, rows - first, columns.data()});
                      });
  }
  values_ = {};
  share_patches();
}

void ContactOperator::make_place() const
{
  values_ = vector_on_large_pages(rows_ * rows_);
  values_.resize(rows_ * rows_);
}

/// Both triangles of the columns of a rank.
void ContactOperator::fill_whole(std::size_t first_column, std::size_t last_column, const double* entry) const
{
  for_each_strip_of(first_column, last_column,
                    [&](std::size_t first, std::size_t last)
                    {
                      for (std::size_t j = first; j < last; ++j, entry += rows_ - first)
                        for (std::size_t i = j; i < rows_; ++i)
                          values_[i * rows_ + j] = values_[j * rows_ + i] = entry[i - first];
                    });
}

void ContactOperator::gather() const
{
  held_whole_ = true;
  if (rank_of(shared_by_) != 0) return send(strips_.values, 0, shared_by_);
  fill_whole(strips_.first, strips_.last, strips_.values.data());
  const int ranks = ranks_of(shared_by_);
  std::vector<double> columns;
  for (int rank = 1; rank < ranks; ++rank)
  {
    receive(columns, rank, shared_by_);
    fill_whole(first_column(rows_, rank, ranks), first_column(rows_, rank + 1, ranks), columns.data());
  }
}

void ContactOperator::hold_whole() const
{
  if (shared_by_ == MPI_COMM_NULL || products_ || held_whole_) return;
  on_rank_zero(shared_by_, [&] { make_place(); });
  gather();
}

void ContactOperator::ask_for_whole() const
{
  if (shared_by_ == MPI_COMM_NULL || products_ || held_whole_) return;
  make_place(); // before the others wait for it: there may be none
  int task = task_of_gathering;
  MPI_Bcast(&task, 1, MPI_INT, 0, shared_by_);
  gather();
}

void ContactOperator::share_patches()
{
  const int me = rank_of(shared_by_), ranks = ranks_of(shared_by_);
  if (me == 0 && ranks > 1) divide_single_patch(near_, diagonal_, PairRows<std::size_t>(directions_));
  std::size_t patches = near_.patches.size();
  MPI_Bcast(&patches, sizeof patches, MPI_BYTE, 0, shared_by_);
  if (patches < 2) return;
  MPI_Bcast(&pairs_, sizeof pairs_, MPI_BYTE, 0, shared_by_);
  MPI_Bcast(&directions_, 1, MPI_INT, 0, shared_by_);
  broadcast(diagonal_, shared_by_);
  broadcast(scale_, shared_by_);
  near_.patches.resize(patches);
  for (std::vector<std::size_t>& patch : near_.patches) broadcast(patch, shared_by_);
  MPI_Bcast(&near_.in_turn, sizeof near_.in_turn, MPI_BYTE, 0, shared_by_);
  if (me == 0) owners_ = near_.in_turn ? owners_of_pieces(patches, ranks) : owners_by_size(near_, ranks);
  broadcast(owners_, shared_by_);
  std::vector<int> owner(pairs_); // of pairs
  for (std::size_t patch = 0; patch < patches; ++patch)
    for (const std::size_t pair : near_.patches[patch]) owner[pair] = owners_[patch];
  near_.inside.resize(pairs_); // rank 0 keeps all, for where sweeps patch by patch do not converge
  beyond_.resize(pairs_);
  for (std::size_t pair = 0; pair < pairs_; ++pair)
  {
    if (owner[pair] != 0 && me == 0) send_row(near_.inside[pair], owner[pair], shared_by_);
    if (owner[pair] != 0 && me == owner[pair]) near_.inside[pair] = receive_row(shared_by_);
    const auto part = [&](int rank)
    {
      return part_of(near_.outside[pair], PairRows<std::size_t>(directions_).per_pair(),
                     [&](std::size_t other) { return owner[other] == rank; });
    };
    for (int rank = 1; me == 0 && rank < ranks; ++rank) send_row(part(rank), rank, shared_by_);
    beyond_[pair] = me == 0 ? part(0) : receive_row(shared_by_);
  }
}

void ContactOperator::add_strips(const std::vector<double>& x, std::vector<double>& y) const
{
  for_each_strip(
      [&](const CondensedStrip& strip)
      {
        add_symmetric_product(strip.values, strip.height, strip.last - strip.first, x.data() + strip.first,
                              y.data() + strip.first);
      });
}

/// y = W x
void ContactOperator::multiply_stored(std::vector<double>& x, std::vector<double>& y) const
{
  if (shared_by_ == MPI_COMM_NULL) return add_symmetric_product(values_.data(), size(), size(), x.data(), y.data());
  int task = task_of_product;
  MPI_Bcast(&task, 1, MPI_INT, 0, shared_by_);
  MPI_Bcast(x.data(), to_int(x.size()), MPI_DOUBLE, 0, shared_by_);
  add_strips(x, y);
  MPI_Reduce(MPI_IN_PLACE, y.data(), to_int(y.size()), MPI_DOUBLE, MPI_SUM, 0, shared_by_);
}

/// On rank 0.
void ContactOperator::multiply_by_factor(std::span<const double> x, std::span<double> y) const
{
  int task = task_of_product;
  if (shared_by_ != MPI_COMM_NULL) MPI_Bcast(&task, 1, MPI_INT, 0, shared_by_);
  const std::vector<double> Ex = products_->products.product(x);
  const std::vector<double>& added = products_->diagonal;
  for (std::size_t i = 0; i < y.size(); ++i) y[i] = products_->scale * Ex[i] + (added.empty() ? 0 : added[i] * x[i]);
}

void ContactOperator::follow_product() const
{
  int task = 0;
  MPI_Bcast(&task, 1, MPI_INT, 0, shared_by_);
  serve_product();
}

void ContactOperator::serve_product() const
{
  if (products_)
  {
    (void)products_->products.product({});
    return;
  }
  std::vector<double> x(rows_), y(rows_);
  MPI_Bcast(x.data(), to_int(x.size()), MPI_DOUBLE, 0, shared_by_);
  add_strips(x, y);
  MPI_Reduce(y.data(), nullptr, to_int(y.size()), MPI_DOUBLE, MPI_SUM, 0, shared_by_);
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
    else if (task == task_of_gathering)
      W.gather();
    else
      W.serve_product();
  }
}

ServedProducts::~ServedProducts()
{
  int task = end_of_service;
  if (W_.shared_by() != MPI_COMM_NULL && rank_of(W_.shared_by()) == 0) MPI_Bcast(&task, 1, MPI_INT, 0, W_.shared_by());
}

} // namespace squeal
