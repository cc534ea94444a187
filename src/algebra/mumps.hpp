#pragma once
/// The interface to MUMPS (Amestoy, Duff, L'Excellent, Koster 2001): one factor over all ranks, in a given order of
/// elimination, from entries that are distributed. Every call is collective. MUMPS's INFOG is the same on all ranks, so
/// that its errors are thrown on all ranks together.
#include "triplets.hpp"

#include <dmumps_c.h>
#include <memory>

namespace squeal
{

/// Ends an instance, and holds the places of its entries in MUMPS's own integers.
struct EndMumps
{
  std::vector<MUMPS_INT> row, column;

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

/// Parameter SYM of MUMPS. Its value 1, for positive definite matrices, is not used: negative pivots are not counted.
enum class MumpsSymmetry
{
  none = 0,      // L U
  symmetric = 2, // L D L', with the number of negative pivots
};

/// An instance without output.
Mumps start_mumps(MPI_Comm comm, MumpsSymmetry symmetry);

/// Sets the controls that the options -<prefix>mat_mumps_icntl_N and -<prefix>mat_mumps_cntl_N give. Those of the
/// matrix's format, of the counted pivots and of single solves are the program's own and not asked for.
void set_controls_from_options(DMUMPS_STRUC_C& mumps, const char* prefix);

/// ICNTL(number), counted from one as in MUMPS's manual.
inline MUMPS_INT& control(DMUMPS_STRUC_C& mumps, int number)
{
  return mumps.icntl[number - 1];
}

/// INFOG(number), counted from one as in MUMPS's manual.
inline MUMPS_INT information(const DMUMPS_STRUC_C& mumps, int number)
{
  return mumps.infog[number - 1];
}

/// INFOG(12), of the last factorisation.
inline int number_of_negative_pivots(const DMUMPS_STRUC_C& mumps)
{
  return information(mumps, 12);
}

/// Throws LibraryError if the job fails.
void run(DMUMPS_STRUC_C& mumps, MumpsJob job);

/// Sets the matrix of `size` rows. Moves rows and columns of the entries out; MUMPS borrows their values until the last
/// factorisation.
void set_entries(Mumps& mumps, Triplets& entries, int size);

/// Factorises, and again with more memory beyond MUMPS's estimate, ICNTL(14), where that was too little. Returns false
/// if the matrix is singular; throws LibraryError for any other failure.
bool factorise(DMUMPS_STRUC_C& mumps);

} // namespace squeal
