#pragma once
/// What squeal says to MUMPS (Amestoy, Duff, L'Excellent, Koster 2001): one factor over all ranks, every rank giving
/// its share of the entries, in an order of elimination that is given. Every call is collective, and MUMPS's INFOG is
/// the same on all ranks: what it complains of is thrown on all together.
#include "triplets.hpp"

#include <dmumps_c.h>
#include <memory>

namespace squeal
{

struct EndMumps
{
  void operator()(DMUMPS_STRUC_C* mumps) const;
};

using Mumps = std::unique_ptr<DMUMPS_STRUC_C, EndMumps>;

enum class MumpsJob
{
  start = -1,
  end = -2,
  analyse = 1,
  factorise = 2,
  solve = 3,
};

/// Silent; `symmetry` as MUMPS numbers it: 0 for L U, 2 for L D L', which counts its negative pivots.
Mumps start_mumps(MPI_Comm comm, int symmetry);

/// MUMPS's own numbering of its controls, which counts from one.
inline MUMPS_INT& control(DMUMPS_STRUC_C& mumps, int number)
{
  return mumps.icntl[number - 1];
}

/// LibraryError if it fails.
void run(DMUMPS_STRUC_C& mumps, MumpsJob job);

/// The matrix, `size` rows: lent until it is factored for the last time.
void set_entries(DMUMPS_STRUC_C& mumps, Triplets& mine, int size);

/// With as much room beyond its estimate, ICNTL(14), as it turns out to need. False if the matrix is singular.
bool factorise(DMUMPS_STRUC_C& mumps);

} // namespace squeal
