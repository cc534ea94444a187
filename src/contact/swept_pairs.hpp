#pragma once
/// The pairs that Gauss-Seidel sweeps visit, and how ranks divide them.
#include "squeal/contact/contact_operator.hpp"

namespace squeal
{

/// Patches that are swept side by side.
struct Turn
{
  struct Part
  {
    std::size_t first, count; // of `order`
  };
  std::vector<std::size_t> order{}; // pairs, rank by rank
  std::vector<Part> own{};          // patches of this rank
  std::vector<int> counts{};        // pairs of each rank that shares them

  std::span<const std::size_t> pairs(const Part& part) const
  {
    return std::span(order).subspan(part.first, part.count);
  }
};

/// The pairs that sweeps visit, patch after patch. Of several patches each is swept by itself, and reactions act on the
/// others at the end of a turn: when all have been swept, or the even or odd pieces of a single patch, which several
/// ranks divide. So sweeps do not depend on the number of ranks, but for those of a single patch on one rank.
struct SweptPairs
{
  std::vector<Turn> turns{};
  bool several = false;          // patches, on all ranks
  MPI_Comm comm = MPI_COMM_NULL; // ranks that sweep side by side

  bool shared() const { return comm != MPI_COMM_NULL; }
  bool by_pieces() const { return turns.size() > 1; }

  /// work(pair) of all of this rank's.
  template <class Work> void for_each_own(Work work) const
  {
    for (const Turn& turn : turns)
      for (const Turn::Part& part : turn.own)
        for (const std::size_t pair : turn.pairs(part)) work(pair);
  }
};

/// All pairs, on this rank alone.
SweptPairs one_patch(const ContactOperator& W);

/// The operator's patches, divided among the ranks that share them.
SweptPairs patches_of(const ContactOperator& W);

} // namespace squeal
