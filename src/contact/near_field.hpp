#pragma once
/// The near field of W (contact_operator.hpp) and the pairs that each rank sweeps over.
#include "squeal/contact/contact_operator.hpp"

namespace squeal
{

struct NearField
{
  std::vector<NearRow> rows;         // of every pair, in the columns of this rank's pairs
  std::vector<std::size_t> order;    // pairs from one end of the contact to the other
  std::vector<std::size_t> of_ranks; // the first place in `order` of each rank, and the end
};

/// The entries that couple the rows of pair i with those of pair j, whose columns these are; i >= j.
PairBlock block_of(const CondensedStrip& columns, const PairRows<std::size_t>& rows, std::size_t i, std::size_t j);

/// `own`: the columns of this rank (column_shares). Collective.
NearField make_near_field(const CondensedStrip& own, std::size_t pairs, int directions, MPI_Comm comm);

} // namespace squeal
