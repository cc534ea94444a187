#include "squeal/analysis/complex_factor.hpp"

#include "squeal/contact/mumps.hpp"

#include <algorithm>
#include <cstring>
#include <zmumps_c.h>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Index = std::size_t;

// The entries of K, C and M, one after the other: MUMPS sums those of one place.
struct Entries
{
  std::vector<MUMPS_INT> row, column; // from one
  std::vector<double> value;
  Index first_of_C = 0, first_of_M = 0;
};

void append(Mat A, Entries& entries)
{
  for_each_row(A,
               [&](PetscInt row, std::span<const PetscInt> columns, std::span<const PetscScalar> values)
               {
                 entries.row.insert(entries.row.end(), columns.size(), static_cast<MUMPS_INT>(row + 1));
                 for (const PetscInt column : columns) entries.column.push_back(static_cast<MUMPS_INT>(column + 1));
                 entries.value.insert(entries.value.end(), values.begin(), values.end());
               });
}

} // namespace

struct ComplexFactor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  Shares shares;
  Entries entries;
  std::vector<Complex> values, right;
  Complex s;
  ZMUMPS_STRUC_C mumps;

  bool here() const { return rank_of(comm) == 0; }
  void run(MumpsJob job, const char* phase);
  void gather(const ComplexBlock& X);
  ComplexBlock scatter(const ComplexBlock& pattern);
};

void ComplexFactor::Parts::run(MumpsJob job, const char* phase)
{
  mumps.job = static_cast<MUMPS_INT>(job);
  const auto work = [&] { zmumps_c(&mumps); };
  job == MumpsJob::factorise ? factorise_in_room(mumps, work) : work();
  if (mumps.infog[0] < 0)
    throw LibraryError("MUMPS's " + std::string(phase) + " of the modes at a complex shift: INFOG(1) = " +
                       std::to_string(mumps.infog[0]) + ", which its manual explains (-13: out of memory)");
}

// Columns of all ranks to `right` on rank 0.
void ComplexFactor::Parts::gather(const ComplexBlock& X)
{
  const auto total = static_cast<Index>(shares.total());
  if (here()) right.resize(total * static_cast<Index>(X.columns()));
  std::vector<Complex> mine(static_cast<Index>(X.re.rows));
  for (PetscInt j = 0; j < X.columns(); ++j)
  {
    for (PetscInt i = 0; i < X.re.rows; ++i) mine[static_cast<Index>(i)] = {X.re.column(j)[i], X.im.column(j)[i]};
    MPI_Gatherv(mine.data(), static_cast<int>(mine.size()), MPI_CXX_DOUBLE_COMPLEX,
                right.data() + (here() ? static_cast<Index>(j) * total : 0), shares.counts.data(), shares.starts.data(),
                MPI_CXX_DOUBLE_COMPLEX, 0, comm);
  }
}

ComplexBlock ComplexFactor::Parts::scatter(const ComplexBlock& pattern)
{
  ComplexBlock X = pattern;
  const auto total = static_cast<Index>(shares.total());
  std::vector<Complex> mine(static_cast<Index>(X.re.rows));
  for (PetscInt j = 0; j < X.columns(); ++j)
  {
    MPI_Scatterv(right.data() + (here() ? static_cast<Index>(j) * total : 0), shares.counts.data(),
                 shares.starts.data(), MPI_CXX_DOUBLE_COMPLEX, mine.data(), static_cast<int>(mine.size()),
                 MPI_CXX_DOUBLE_COMPLEX, 0, comm);
    for (PetscInt i = 0; i < X.re.rows; ++i)
    {
      X.re.column(j)[i] = mine[static_cast<Index>(i)].real();
      X.im.column(j)[i] = mine[static_cast<Index>(i)].imag();
    }
  }
  return X;
}

ComplexFactor::ComplexFactor(const QuadraticProblem& problem) : parts_(std::make_unique<Parts>())
{
  Parts& parts = *parts_;
  parts.comm = comm_of(problem.K);
  parts.shares = shares_of(problem.K);
  append(problem.K, parts.entries);
  parts.entries.first_of_C = parts.entries.value.size();
  append(problem.C, parts.entries);
  parts.entries.first_of_M = parts.entries.value.size();
  append(problem.M, parts.entries);
  parts.values.resize(parts.entries.value.size());
  ZMUMPS_STRUC_C& mumps = parts.mumps;
  std::memset(&mumps, 0, sizeof mumps);
  mumps.par = 1;
  mumps.sym = 0;
  mumps.comm_fortran = static_cast<MUMPS_INT>(MPI_Comm_c2f(parts.comm));
  parts.run(MumpsJob::start, "start");
  for (const int stream : {1, 2, 3}) control(mumps, stream) = -1;
  control(mumps, 4) = 0;   // silent
  control(mumps, 14) = 30; // [%] room beyond its estimate
  control(mumps, 18) = 3;  // every rank gives its share of the entries
  mumps.n = parts.shares.total();
  mumps.nnz_loc = static_cast<MUMPS_INT8>(parts.values.size());
  mumps.irn_loc = parts.entries.row.data();
  mumps.jcn_loc = parts.entries.column.data();
  mumps.a_loc = reinterpret_cast<ZMUMPS_COMPLEX*>(parts.values.data());
  parts.run(MumpsJob::analyse, "analysis");
}

ComplexFactor::~ComplexFactor()
{
  parts_->mumps.job = static_cast<MUMPS_INT>(MumpsJob::end);
  zmumps_c(&parts_->mumps);
}

void ComplexFactor::move_to(Complex s)
{
  Parts& parts = *parts_;
  const Entries& entries = parts.entries;
  for (Index k = 0; k < entries.value.size(); ++k)
    parts.values[k] = entries.value[k] * (k < entries.first_of_C ? 1. : k < entries.first_of_M ? s : s * s);
  parts.s = s;
  parts.run(MumpsJob::factorise, "factorisation");
}

Complex ComplexFactor::s() const
{
  return parts_->s;
}

ComplexBlock ComplexFactor::solved(const ComplexBlock& X) const
{
  Parts& parts = *parts_;
  parts.gather(X);
  control(parts.mumps, 27) = static_cast<MUMPS_INT>(X.columns()); // all of them at each reading of the factor
  parts.mumps.rhs = reinterpret_cast<ZMUMPS_COMPLEX*>(parts.right.data());
  parts.mumps.nrhs = static_cast<MUMPS_INT>(X.columns());
  parts.mumps.lrhs = parts.shares.total();
  parts.run(MumpsJob::solve_phase, "solution");
  return parts.scatter(X);
}

} // namespace squeal
