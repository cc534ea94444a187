/// Products that ranks form together. Of a W whose columns they share: y = sum over ranks of what the lower triangle of
/// their columns and its transpose have in W x. Columns go to ranks by equal parts of the triangle. Of a W in the
/// factor: each rank reads its part of the factor.
#include "squeal/algebra/large_pages.hpp"
#include "squeal/algebra/panel.hpp"
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

/// Calls work(first, width) for each strip of columns.
template <class Work> void for_each_strip(std::size_t first, std::size_t last, Work work)
{
  for (std::size_t j = first; j < last; j += tile) work(j, std::min(tile, last - j));
}

} // namespace

void ContactOperator::share_columns(MPI_Comm comm)
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
  int more = 1;
  MPI_Bcast(&more, 1, MPI_INT, 0, shared_by_);
  std::vector<double> from(x.begin(), x.end());
  MPI_Bcast(from.data(), to_int(rows_), MPI_DOUBLE, 0, shared_by_);
  add_symmetric_product(values_.data(), rows_, strips_.last, x.data(), y.data());
  MPI_Reduce(MPI_IN_PLACE, y.data(), to_int(rows_), MPI_DOUBLE, MPI_SUM, 0, shared_by_);
}

/// On rank 0.
std::vector<double> ContactOperator::multiply_by_factor(std::span<const double> x, std::size_t columns) const
{
  int more = to_int(columns);
  if (shared_by_ != MPI_COMM_NULL) MPI_Bcast(&more, 1, MPI_INT, 0, shared_by_);
  std::vector<double> y = products_->products.product(x, columns);
  const std::vector<double>& added = products_->diagonal;
  for (std::size_t i = 0; i < y.size(); ++i)
    y[i] = products_->scale * y[i] + (added.empty() ? 0 : added[i % added.size()] * x[i]);
  return y;
}

void ContactOperator::serve() const
{
  std::vector<double> x(rows_), y(rows_);
  for (int more = 1;;)
  {
    MPI_Bcast(&more, 1, MPI_INT, 0, shared_by_); // vectors to be multiplied
    if (!more) return;
    if (products_)
    {
      (void)products_->products.product({}, static_cast<std::size_t>(more));
      continue;
    }
    MPI_Bcast(x.data(), to_int(rows_), MPI_DOUBLE, 0, shared_by_);
    std::fill(y.begin(), y.end(), 0.);
    add_strips(x, y);
    MPI_Reduce(y.data(), nullptr, to_int(rows_), MPI_DOUBLE, MPI_SUM, 0, shared_by_);
  }
}

void ContactOperator::end_products() const
{
  int more = 0;
  MPI_Bcast(&more, 1, MPI_INT, 0, shared_by_);
}

ServedProducts::ServedProducts(const ContactOperator& W) : W_(W)
{
  if (W.shared_by_ != MPI_COMM_NULL && rank_of(W.shared_by_) != 0) W.serve();
}

ServedProducts::~ServedProducts()
{
  if (W_.shared_by_ != MPI_COMM_NULL && rank_of(W_.shared_by_) == 0) W_.end_products();
}

} // namespace squeal
