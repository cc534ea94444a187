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
  int mode = unmatched; // of the reference
  std::complex<double> lambda{};
};

/// A sample with its unstable modes, or why there are none.
struct SampleResult
{
  RobustSample sample{};
  std::vector<UnstableMode> unstable{};
  std::string problem{}; // empty: it is known
};

/// A check, or why there is none.
struct CheckResult
{
  RobustCheck check{};
  std::string problem{};
};

void describe(Checkpoint& checkpoint, SampleResult& result);
void describe(Checkpoint& checkpoint, CheckResult& result);

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

/// Of so many numbers with the growth rates over |lambda| of the samples whose mode oscillates.
void find_correlations(Robustness& result, std::size_t numbers);

/// Probabilities of the unstable modes that are one of the reference's, and of any.
void find_probabilities(Robustness& result, const std::vector<SampleResult>& samples,
                        const std::vector<std::complex<double>>& reference, double confidence);

/// Sets the outcome, with the first failure of samples, or else of checks.
void assess(Robustness& result, const std::vector<SampleResult>& samples, const std::vector<CheckResult>& checks);

} // namespace squeal
