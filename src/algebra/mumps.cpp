#include "mumps.hpp"

#include <algorithm>
#include <string>

namespace squeal
{

namespace
{

constexpr int singular = -10, most_room = 2000; // INFOG(1); [%] beyond MUMPS's estimate

/// Pivots that are put off, and messages between ranks, need more than was estimated.
bool short_of_room(int outcome)
{
  return outcome == -8 || outcome == -9 || outcome == -17 || outcome == -20;
}

int outcome_of(DMUMPS_STRUC_C& mumps, MumpsJob job)
{
  mumps.job = static_cast<MUMPS_INT>(job);
  dmumps_c(&mumps);
  return mumps.infog[0];
}

[[noreturn]] void give_up(const DMUMPS_STRUC_C& mumps)
{
  throw LibraryError("MUMPS, job " + std::to_string(mumps.job) + ": INFOG(1) = " + std::to_string(mumps.infog[0]) +
                     ", INFOG(2) = " + std::to_string(mumps.infog[1]) + "; its manual lists them (-13: out of memory)");
}

} // namespace

void EndMumps::operator()(DMUMPS_STRUC_C* mumps) const
{
  outcome_of(*mumps, MumpsJob::end);
  delete mumps;
}

Mumps start_mumps(MPI_Comm comm, int symmetry)
{
  Mumps mumps(new DMUMPS_STRUC_C{});
  mumps->par = 1;
  mumps->sym = symmetry;
  mumps->comm_fortran = static_cast<MUMPS_INT>(MPI_Comm_c2f(comm));
  run(*mumps, MumpsJob::start);
  for (const int stream : {1, 2, 3}) control(*mumps, stream) = -1;
  control(*mumps, 4) = 0;  // silent
  control(*mumps, 7) = 1;  // the order that is given
  control(*mumps, 13) = 1; // no ScaLAPACK: the negative pivots of a root that it factors are not counted
  control(*mumps, 18) = 3; // every rank gives its share of the entries
  return mumps;
}

void run(DMUMPS_STRUC_C& mumps, MumpsJob job)
{
  if (outcome_of(mumps, job) < 0) give_up(mumps);
}

void set_entries(DMUMPS_STRUC_C& mumps, Triplets& mine, int size)
{
  mumps.n = size;
  mumps.nnz_loc = static_cast<MUMPS_INT8>(mine.value.size());
  mumps.irn_loc = mine.row.data();
  mumps.jcn_loc = mine.column.data();
  mumps.a_loc = mine.value.data();
}

bool factorise(DMUMPS_STRUC_C& mumps)
{
  int outcome = outcome_of(mumps, MumpsJob::factorise);
  for (MUMPS_INT& room = control(mumps, 14); short_of_room(outcome) && room < most_room;
       outcome = outcome_of(mumps, MumpsJob::factorise))
    room = 4 * std::max<MUMPS_INT>(room, 0) + 10;
  if (outcome < 0 && outcome != singular) give_up(mumps);
  return outcome != singular;
}

} // namespace squeal
