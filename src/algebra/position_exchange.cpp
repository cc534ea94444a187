#include "position_exchange.hpp"

#include <numeric>

namespace squeal
{

namespace
{

std::vector<int> times(const std::vector<int>& counts, int columns)
{
  std::vector<int> result = counts;
  for (int& count : result) count *= columns;
  return result;
}

} // namespace

PositionExchange::PositionExchange(const RowLayout& layout, const std::vector<int>& position,
                                   const std::vector<int>& owner, MPI_Comm comm)
    : comm_(comm)
{
  const int ranks = ranks_of(comm), me = rank_of(comm);
  std::vector<std::vector<std::size_t>> out(static_cast<std::size_t>(ranks)), in(out.size());
  for (std::size_t rank = 0; rank < out.size(); ++rank)
    for (int i = 0; i < layout.counts[rank]; ++i)
    {
      const auto place = static_cast<std::size_t>(position[static_cast<std::size_t>(layout.starts[rank] + i)]);
      const bool mine = static_cast<int>(rank) == me;
      const int target = owner.empty() ? me : owner[place];
      if (mine && (target < 0 || target == me))
        in_place_.emplace_back(i, place);
      else if (mine)
        out[static_cast<std::size_t>(target)].push_back(static_cast<std::size_t>(i));
      else if (target == me)
        in[rank].push_back(place);
    }
  const auto joined = [](const std::vector<std::vector<std::size_t>>& lists)
  {
    Rows rows;
    for (const auto& list : lists)
    {
      rows.starts.push_back(static_cast<int>(rows.places.size()));
      rows.counts.push_back(static_cast<int>(list.size()));
      rows.places.insert(rows.places.end(), list.begin(), list.end());
    }
    return rows;
  };
  rows_ = joined(out);
  positions_ = joined(in);
}

void PositionExchange::swap(const Rows& from, const Rows& to, int columns, const std::vector<double>& out,
                            std::vector<double>& in, MPI_Comm comm)
{
  const std::vector<int> sent = times(from.counts, columns), sent_from = times(from.starts, columns),
                         received = times(to.counts, columns), received_to = times(to.starts, columns);
  MPI_Alltoallv(out.data(), sent.data(), sent_from.data(), MPI_DOUBLE, in.data(), received.data(), received_to.data(),
                MPI_DOUBLE, comm);
}

void PositionExchange::gather(std::span<const double* const> b, std::size_t lanes, std::vector<double>& x) const
{
  const std::size_t columns = b.size();
  for (const auto& [row, position] : in_place_)
    for (std::size_t k = 0; k < columns; ++k) x[position * lanes + k] = b[k][row];
  if (rows_.counts.size() < 2) return;
  std::vector<double> out(rows_.places.size() * columns), in(positions_.places.size() * columns);
  for (std::size_t i = 0; i < rows_.places.size(); ++i)
    for (std::size_t k = 0; k < columns; ++k) out[i * columns + k] = b[k][rows_.places[i]];
  swap(rows_, positions_, static_cast<int>(columns), out, in, comm_);
  for (std::size_t i = 0; i < positions_.places.size(); ++i)
    for (std::size_t k = 0; k < columns; ++k) x[positions_.places[i] * lanes + k] = in[i * columns + k];
}

void PositionExchange::scatter(const std::vector<double>& x, std::size_t lanes, std::span<double* const> b) const
{
  const std::size_t columns = b.size();
  for (const auto& [row, position] : in_place_)
    for (std::size_t k = 0; k < columns; ++k) b[k][row] = x[position * lanes + k];
  if (rows_.counts.size() < 2) return;
  std::vector<double> out(positions_.places.size() * columns), in(rows_.places.size() * columns);
  for (std::size_t i = 0; i < positions_.places.size(); ++i)
    for (std::size_t k = 0; k < columns; ++k) out[i * columns + k] = x[positions_.places[i] * lanes + k];
  swap(positions_, rows_, static_cast<int>(columns), out, in, comm_);
  for (std::size_t i = 0; i < rows_.places.size(); ++i)
    for (std::size_t k = 0; k < columns; ++k) b[k][rows_.places[i]] = in[i * columns + k];
}

} // namespace squeal
