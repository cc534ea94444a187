#include "position_exchange.hpp"

namespace squeal
{

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

} // namespace squeal
