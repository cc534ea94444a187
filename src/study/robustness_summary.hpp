#pragma once
/// What the ranks found of random samples, put together: probabilities and correlations (src/README.md, section 12.3).
#include "squeal/study/robustness.hpp"
#include "sweep_checkpoint.hpp"

namespace squeal
{

inline constexpr int unmatched = -1; // a mode that is like none of the reference

/// An unstable mode of a sample.
struct UnstableMode
{
  int sample = 0;
  int mode = unmatched; // of the reference
  std::complex<double> lambda{};
};

void describe(Checkpoint& checkpoint, RobustSample& sample);
void describe(Checkpoint& checkpoint, RobustCheck& check);
void describe(Checkpoint& checkpoint, UnstableMode& mode);

/// Gives every rank the entries that each has computed, in turn: the first rank the first of them. Collective.
template <class Entry> void share_in_turn(std::vector<Entry>& entries, MPI_Comm comm)
{
  const std::vector<Entry> own = entries;
  for (int rank = 0; rank < ranks_of(comm); ++rank)
  {
    const std::vector<Entry> theirs = of_rank(rank, own, comm);
    for (auto k = static_cast<std::size_t>(rank); k < entries.size(); k += static_cast<std::size_t>(ranks_of(comm)))
      entries[k] = theirs[k];
  }
}

/// Gives every rank all unstable modes, by samples.
void share(std::vector<UnstableMode>& modes, MPI_Comm comm);

/// Of so many numbers with the growth rates over |lambda| of the samples whose mode oscillates.
void find_correlations(Robustness& result, std::size_t numbers);

/// Probabilities of the unstable modes that are one of the reference's, and of any.
void find_probabilities(Robustness& result, const std::vector<UnstableMode>& unstable,
                        const std::vector<std::complex<double>>& reference, double confidence);

/// A sample that could not be computed, and why; no reason: there is none.
struct SampleFailure
{
  int sample = 0;
  std::string reason{};
};

/// The first one of those of all ranks, on every rank. Collective.
SampleFailure first_of_ranks(SampleFailure own, MPI_Comm comm);

/// Sets the outcome, with the first failure.
void assess(Robustness& result, const SampleFailure& first);

} // namespace squeal
