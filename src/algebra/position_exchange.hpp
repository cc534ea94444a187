#pragma once
/// Right-hand sides and solutions between the ranks that own their rows and those that own their positions in a
/// supernodal factor. The rows of shared supernodes stay where they are.
#include "squeal/base/petsc.hpp"

#include <vector>

namespace squeal
{

class PositionExchange
{
public:
  PositionExchange() = default;

  /// `position`: of each row; `owner`: of each position, empty on one rank.
  PositionExchange(const RowLayout& layout, const std::vector<int>& position, const std::vector<int>& owner,
                   MPI_Comm comm);

  /// Puts b into x, `lanes` numbers a position: what this rank owns, and of shared positions its own rows. Collective.
  void gather(std::span<const double* const> b, std::size_t lanes, std::vector<double>& x) const;

  /// The reverse: the own rows from what the ranks own and what this rank has of shared positions. Collective.
  void scatter(const std::vector<double>& x, std::size_t lanes, std::span<double* const> b) const;

private:
  struct Rows
  {
    std::vector<std::size_t> places{}; // of one rank after the other
    std::vector<int> counts{}, starts{};
  };
  static void swap(const Rows& from, const Rows& to, int columns, const std::vector<double>& out,
                   std::vector<double>& in, MPI_Comm comm);

  MPI_Comm comm_ = MPI_COMM_NULL;
  Rows rows_, positions_;                                     // that go to, and come from, each rank
  std::vector<std::pair<std::size_t, std::size_t>> in_place_; // row and position of what is not sent
};

} // namespace squeal
