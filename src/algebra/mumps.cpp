#include "mumps.hpp"

#include "squeal/base/free_memory.hpp"
#include "squeal/base/petsc.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <string>
#include <type_traits>
#include <utility>

namespace squeal
{

namespace
{

constexpr int singular = -10;          // INFOG(1)
constexpr int out_of_memory = -13;     // INFOG(1)
constexpr int largest_increase = 2000; // [%] beyond MUMPS's estimate of its memory

/// Whether INFOG(1) says that delayed pivots or messages between ranks need more memory than was estimated.
bool exceeds_estimate(int outcome)
{
  return outcome == -8 || outcome == -9 || outcome == -17 || outcome == -20;
}

/// The same numbers as MUMPS's integers, which may have 64 bits.
template <class Integer> std::vector<MUMPS_INT> converted(std::vector<Integer> numbers)
{
  if constexpr (std::is_same_v<MUMPS_INT, Integer>)
    return numbers;
  else
    return {numbers.begin(), numbers.end()};
}

/// INFOG(1) after the job.
int outcome_of(DMUMPS_STRUC_C& mumps, MumpsJob job)
{
  mumps.job = static_cast<MUMPS_INT>(job);
  dmumps_c(&mumps);
  return information(mumps, 1);
}

[[noreturn]] void throw_failure(const DMUMPS_STRUC_C& mumps)
{
  if (information(mumps, 1) == out_of_memory) throw LibraryError(out_of_memory_text);
  throw LibraryError("MUMPS, job " + std::to_string(mumps.job) +
                     ": INFOG(1) = " + std::to_string(information(mumps, 1)) +
                     ", INFOG(2) = " + std::to_string(information(mumps, 2)) + "; its manual lists them");
}

} // namespace

void EndMumps::operator()(DMUMPS_STRUC_C* mumps) const
{
  outcome_of(*mumps, MumpsJob::end);
  delete mumps;
  return_freed_memory();
}

Mumps start_mumps(MPI_Comm comm, MumpsSymmetry symmetry)
{
  Mumps mumps(new DMUMPS_STRUC_C{});
  mumps->par = 1;
  mumps->sym = static_cast<MUMPS_INT>(symmetry);
  mumps->comm_fortran = static_cast<MUMPS_INT>(MPI_Comm_c2f(comm));
  run(*mumps, MumpsJob::start);
  for (const int stream : {1, 2, 3}) control(*mumps, stream) = -1;
  control(*mumps, 4) = 0;  // no output
  control(*mumps, 7) = 1;  // the order of elimination is given
  control(*mumps, 13) = 1; // no ScaLAPACK, since negative pivots of a root that it factors are not counted
  control(*mumps, 18) = 3; // every rank gives its share of the entries
  return mumps;
}

void set_controls_from_options(DMUMPS_STRUC_C& mumps, const char* prefix)
{
  constexpr std::array own = {5, 9, 13, 18, 19, 20, 21, 26, 27};
  for (int number = 1; number <= static_cast<int>(std::size(mumps.icntl)); ++number)
  {
    if (std::ranges::find(own, number) != own.end()) continue;
    auto value = static_cast<PetscInt>(control(mumps, number));
    check(PetscOptionsGetInt(nullptr, prefix, format("-mat_mumps_icntl_%d", number).c_str(), &value, nullptr));
    control(mumps, number) = static_cast<MUMPS_INT>(value);
  }
  for (std::size_t number = 1; number <= std::size(mumps.cntl); ++number)
    check(PetscOptionsGetReal(nullptr, prefix, format("-mat_mumps_cntl_%zu", number).c_str(), &mumps.cntl[number - 1],
                              nullptr));
}

void run(DMUMPS_STRUC_C& mumps, MumpsJob job)
{
  if (outcome_of(mumps, job) < 0) throw_failure(mumps);
}

void set_entries(Mumps& mumps, Triplets& entries, int size)
{
  EndMumps& places = mumps.get_deleter();
  places.row = converted(std::move(entries.row));
  places.column = converted(std::move(entries.column));
  mumps->n = size;
  mumps->nnz_loc = static_cast<MUMPS_INT8>(entries.value.size());
  mumps->irn_loc = places.row.data();
  mumps->jcn_loc = places.column.data();
  mumps->a_loc = entries.value.data();
}

bool factorise(DMUMPS_STRUC_C& mumps)
{
  int outcome = outcome_of(mumps, MumpsJob::factorise);
  for (MUMPS_INT& increase = control(mumps, 14); exceeds_estimate(outcome) && increase < largest_increase;
       outcome = outcome_of(mumps, MumpsJob::factorise))
    increase = 4 * std::max<MUMPS_INT>(increase, 0) + 10;
  if (outcome < 0 && outcome != singular) throw_failure(mumps);
  return outcome != singular;
}

} // namespace squeal
