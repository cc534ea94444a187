#pragma once
/// Right-hand sides and solutions between the ranks that own their rows and those that own their positions in a
/// supernodal factor. The rows of shared supernodes stay where they are.
#include "squeal/base/petsc.hpp"

#include <petscsf.h>
#include <vector>

namespace squeal
{

class PositionExchange
{
public:
  /// `position`: of each row; `owner`: of each position, empty on one rank.
  PositionExchange(const RowLayout& layout, const std::vector<int>& position, const std::vector<int>& owner,
                   MPI_Comm comm);

  /// Puts b into x, `lanes` numbers a position: what this rank owns, and of shared positions its own rows. Collective.
  void gather(std::span<const double* const> b, std::size_t lanes, std::vector<double>& x) const;

  /// The reverse: the own rows from what the ranks own and what this rank has of shared positions. Collective.
  void scatter(const std::vector<double>& x, std::size_t lanes, std::span<double* const> b) const;

private:
  std::vector<std::size_t> positions_; // that this rank fills
  Owned<PetscSF> rows_;                // from the rows to these
};

} // namespace squeal
