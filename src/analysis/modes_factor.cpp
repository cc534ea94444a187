#include "squeal/analysis/pencil_factor.hpp"

#include "../contact/elimination.hpp"

#include <algorithm>
#include <cstring>
#include <dmumps_c.h>

namespace squeal
{

namespace
{

using Index = std::size_t;

enum class Job
{
  start = -1,
  end = -2,
  analyse = 1,
  factorise = 2,
  solve = 3,
};

constexpr int singular = -10, most_room = 2000; // INFOG(1); percent of memory beyond MUMPS's estimate

// Pivots that are put off need more room than was estimated, how much depends on the timing of the ranks.
bool short_of_room(int outcome)
{
  return outcome == -8 || outcome == -9 || outcome == -17 || outcome == -20;
}

int room_option()
{
  PetscInt room = 30;
  check(PetscOptionsGetInt(nullptr, "modes_", "-factor_room", &room, nullptr));
  return static_cast<int>(room);
}

} // namespace

struct PencilFactor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  Shares shares;
  Triplets entries; // those of K, then those of M: MUMPS sums what is of one place
  Index first_of_M = 0;
  std::vector<double> values, right;
  DMUMPS_STRUC_C mumps;

  int run(Job job);
  MUMPS_INT& control(int number) { return mumps.icntl[number - 1]; } // MUMPS counts from one
};

int PencilFactor::Parts::run(Job job)
{
  mumps.job = static_cast<MUMPS_INT>(job);
  dmumps_c(&mumps);
  const int outcome = mumps.infog[0];
  if (outcome < 0 && outcome != singular && !(job == Job::factorise && short_of_room(outcome)))
    throw LibraryError("MUMPS on K - shift M of the modes, job " + std::to_string(static_cast<int>(job)) +
                       ": INFOG(1) = " + std::to_string(outcome) + ", which its manual explains (-13: out of memory)");
  return outcome;
}

PencilFactor::PencilFactor(Mat K, Mat M, Symmetry symmetry) : parts_(std::make_unique<Parts>())
{
  Parts& parts = *parts_;
  DMUMPS_STRUC_C& mumps = parts.mumps;
  parts.comm = comm_of(K);
  parts.shares = shares_of(K);
  const auto append = [&](Mat A)
  { symmetry == Symmetry::none ? append_rows(A, 0, parts.entries) : append_lower_triangle(A, parts.entries); };
  append(K);
  parts.first_of_M = parts.entries.value.size();
  append(M);
  parts.values.resize(parts.entries.value.size());
  Triplets pattern = gathered(lower_triangle(K), Triplets::Part::pattern, parts.comm);
  std::vector<MUMPS_INT> order;
  on_rank_zero(parts.comm,
               [&]
               {
                 for (const int position : eliminate(pattern, parts.shares.total(), 0).position)
                   order.push_back(position + 1);
               });
  std::memset(&mumps, 0, sizeof mumps);
  mumps.par = 1;
  mumps.sym = symmetry == Symmetry::none ? 0 : 2;
  mumps.comm_fortran = static_cast<MUMPS_INT>(MPI_Comm_c2f(parts.comm));
  parts.run(Job::start);
  for (const int stream : {1, 2, 3}) parts.control(stream) = -1;
  parts.control(4) = 0;  // silent
  parts.control(7) = 1;  // the order that is given
  parts.control(13) = 1; // the negative pivots of a root that ScaLAPACK factors are not counted
  parts.control(14) = room_option();
  parts.control(18) = 3; // every rank gives its share of the entries
  mumps.n = parts.shares.total();
  mumps.nnz_loc = static_cast<MUMPS_INT8>(parts.values.size());
  mumps.irn_loc = parts.entries.row.data();
  mumps.jcn_loc = parts.entries.column.data();
  mumps.a_loc = parts.values.data();
  mumps.perm_in = order.data();
  parts.run(Job::analyse);
  mumps.perm_in = nullptr;
}

PencilFactor::~PencilFactor()
{
  parts_->mumps.job = static_cast<MUMPS_INT>(Job::end);
  dmumps_c(&parts_->mumps);
}

bool PencilFactor::factorise(double shift)
{
  Parts& parts = *parts_;
  for (Index k = 0; k < parts.values.size(); ++k)
    parts.values[k] = (k < parts.first_of_M ? 1 : -shift) * parts.entries.value[k];
  int outcome = parts.run(Job::factorise);
  for (; short_of_room(outcome); outcome = parts.run(Job::factorise))
  {
    MUMPS_INT& room = parts.control(14);
    room = 4 * std::max<MUMPS_INT>(room, 0) + 10;
    if (room > most_room)
      throw LibraryError("MUMPS does not get by with " + std::to_string(most_room) +
                         " % of memory beyond its estimate");
  }
  return outcome != singular;
}

int PencilFactor::negative_pivots() const
{
  return parts_->mumps.infog[11];
}

Block PencilFactor::solved(const Block& X) const
{
  Parts& parts = *parts_;
  Block Y = X;
  const bool here = rank_of(parts.comm) == 0;
  const auto total = static_cast<Index>(parts.shares.total()), columns = static_cast<Index>(X.columns);
  if (columns == 0) return Y;
  if (here) parts.right.resize(total * columns);
  const auto whole = [&](PetscInt j) { return parts.right.data() + (here ? static_cast<Index>(j) * total : 0); };
  for (PetscInt j = 0; j < X.columns; ++j)
    MPI_Gatherv(X.column(j), static_cast<int>(X.rows), MPI_DOUBLE, whole(j), parts.shares.counts.data(),
                parts.shares.starts.data(), MPI_DOUBLE, 0, parts.comm);
  parts.control(27) = static_cast<MUMPS_INT>(columns); // all of them at each reading of the factor
  parts.mumps.rhs = parts.right.data();
  parts.mumps.nrhs = static_cast<MUMPS_INT>(columns);
  parts.mumps.lrhs = parts.shares.total();
  parts.run(Job::solve);
  for (PetscInt j = 0; j < X.columns; ++j)
    MPI_Scatterv(whole(j), parts.shares.counts.data(), parts.shares.starts.data(), MPI_DOUBLE, Y.column(j),
                 static_cast<int>(X.rows), MPI_DOUBLE, 0, parts.comm);
  return Y;
}

} // namespace squeal
