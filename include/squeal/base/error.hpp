#pragma once
/// Errors, and how all ranks come to throw them together.
///
/// Bad input and failed calls are exceptions whose text names the place, the value and the remedy. What may fail on one
/// rank only (reading a file on rank 0, say) is agreed by all ranks before anyone throws. No rank is then left waiting
/// in a collective call. A stage that does not converge is a result, never an exception.
#include <exception>
#include <filesystem>
#include <mpi.h>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace squeal
{

/// Bad input or a failed call: the text is what the user reads.
struct Error : std::runtime_error
{
  using std::runtime_error::runtime_error;
};

/// A library call failed, perhaps on this rank alone: the program cannot go on, and must take the other ranks with it.
/// It is no Error, so that work that goes on after one passes this on.
struct LibraryError : std::runtime_error
{
  using std::runtime_error::runtime_error;
};

/// Memory ran out on some rank, and every rank throws.
struct OutOfMemory : LibraryError
{
  using LibraryError::LibraryError;
};

inline constexpr const char* out_of_memory_text = "memory ran out; --dry-run prints a forecast of what a run takes";

/// Collective. Throws Error on every rank, with the text of the lowest rank that brings one, unless all are empty.
void agree(MPI_Comm comm, const std::string& problem);

/// Collective. Throws Error with the text of the lowest rank's failure on every rank, or OutOfMemory if that is what
/// failed there, unless none failed.
void agree(MPI_Comm comm, const std::exception_ptr& failure);

/// Collective. Runs `work`, which must not communicate, on every rank; if it throws on any, all throw Error together.
template <class Work> void on_every_rank(MPI_Comm comm, Work work)
{
  std::exception_ptr failure;
  try
  {
    work();
  }
  catch (...)
  {
    failure = std::current_exception();
  }
  agree(comm, failure);
}

/// Collective. Runs `work` on rank 0 alone; an exception it throws there becomes an Error with the same text
/// everywhere.
template <class Work> void on_rank_zero(MPI_Comm comm, Work work)
{
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  on_every_rank(comm,
                [&]
                {
                  if (rank == 0) work();
                });
}

/// The words of a text, which blanks and ends of lines separate.
std::vector<std::string> words_in(const std::string& text);

/// Returns the text, or its beginning if it has more than 300 characters, for messages. Control characters become '?'.
std::string shortened(const std::string& text);

/// Whether there is a plain file, or a folder, of this name; no name is too long to ask for.
bool is_file(const std::filesystem::path& name);
/// Whether there is a folder of this name.
bool is_folder(const std::filesystem::path& name);

/// Why the name is not that of a plain file; empty if it is.
std::string problem_of_file(const std::filesystem::path& name);

/// printf into text, for messages and tables.
[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...);

/// Number of single-character insertions, deletions and substitutions that turn `a` into `b` (Levenshtein 1966).
int edit_distance(const std::string& a, const std::string& b);

/// The word of `known` with the smallest edit distance to `word`; empty if none is near.
template <class Words> std::string nearest_word(const std::string& word, const Words& known)
{
  std::string best;
  int least = static_cast<int>(word.size()) / 2 + 2;
  for (const auto& candidate : known)
  {
    const int distance = edit_distance(word, candidate);
    if (distance < least)
    {
      least = distance;
      best = candidate;
    }
  }
  return best;
}

/// "; did you mean 'best'?", or nothing.
template <class Words> std::string spelling_hint(const std::string& word, const Words& known)
{
  const std::string best = nearest_word(word, known);
  return best.empty() ? "" : "; did you mean '" + best + "'?";
}

/// A size as the int that MPI, METIS and MUMPS take. Throws Error if it does not fit.
template <class Integer> int to_int(Integer value)
{
  if (!std::in_range<int>(value))
    throw Error("a size of " + std::to_string(value) + " exceeds what MPI, METIS and MUMPS take (2^31 - 1)");
  return static_cast<int>(value);
}

} // namespace squeal
