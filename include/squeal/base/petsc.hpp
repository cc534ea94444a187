#pragma once
/// PETSc and SLEPc: the session, the error check, and the one handle that owns a library object.
///
/// The libraries' own API stays visible: functions borrow raw handles (Vec, Mat, …), results own them (Owned<Vec>).
#include "squeal/base/error.hpp"

#include <slepc.h>
#include <source_location>
#include <span>
#include <utility>
#include <vector>

#ifndef PETSC_SUCCESS
#define PETSC_SUCCESS 0
#endif

namespace squeal
{

/// Starts MPI, PETSc and SLEPc, and ends them. Library errors become a squeal::LibraryError with PETSc's own text.
class Session
{
public:
  Session(int& argc, char**& argv, const char* help);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
};

/// Throws LibraryError with PETSc's text, the file and the line if a library call failed.
void check(PetscErrorCode code, std::source_location where = std::source_location::current());

inline PetscErrorCode destroy(Vec* object)
{
  return VecDestroy(object);
}
inline PetscErrorCode destroy(Mat* object)
{
  return MatDestroy(object);
}
inline PetscErrorCode destroy(KSP* object)
{
  return KSPDestroy(object);
}
inline PetscErrorCode destroy(SNES* object)
{
  return SNESDestroy(object);
}
inline PetscErrorCode destroy(PEP* object)
{
  return PEPDestroy(object);
}
inline PetscErrorCode destroy(IS* object)
{
  return ISDestroy(object);
}
inline PetscErrorCode destroy(VecScatter* object)
{
  return VecScatterDestroy(object);
}
inline PetscErrorCode destroy(PetscViewer* object)
{
  return PetscViewerDestroy(object);
}

/// Sole owner of a library object; moves, never copies. The only place that destroys one.
template <class Handle> class Owned
{
public:
  Owned() = default;
  explicit Owned(Handle handle) : handle_(handle) {}
  Owned(Owned&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Owned& operator=(Owned&& other) noexcept
  {
    std::swap(handle_, other.handle_);
    return *this;
  }
  Owned(const Owned&) = delete;
  Owned& operator=(const Owned&) = delete;
  ~Owned()
  {
    if (handle_) (void)destroy(&handle_);
  }

  operator Handle() const { return handle_; } // lends the handle to a library call
  Handle get() const { return handle_; }

  /// The address for a library call that creates the object; drops what was owned before.
  Handle* put()
  {
    if (handle_) check(destroy(&handle_));
    handle_ = nullptr;
    return &handle_;
  }

private:
  Handle handle_ = nullptr;
};

/// A vector of the same layout; its entries are zero.
Owned<Vec> zeros_like(Vec pattern);

/// A vector of the same layout and entries.
Owned<Vec> copy_of(Vec source);

/// The entries of a small distributed vector, whole on every rank. Collective.
std::vector<double> whole(Vec x);

/// The inverse: this rank's share of `entries` into x.
void set_whole(Vec x, std::span<const double> entries);

/// How many rows each rank has of an object's, and where they start, as MPI's gathers take them.
struct Shares
{
  std::vector<int> counts, starts;
  int total() const { return starts.back() + counts.back(); }
};

Shares shares_of(Vec x);
Shares shares_of(Mat A); // of its rows

/// visit(row, columns, values) for every row of this rank; the spans end with the call.
template <class Visit> void for_each_row(Mat A, Visit visit)
{
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(A, &first, &last));
  for (PetscInt row = first; row < last; ++row)
  {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    check(MatGetRow(A, row, &count, &columns, &values));
    const auto length = static_cast<std::size_t>(count);
    visit(row, std::span(columns, length), std::span(values, length));
    check(MatRestoreRow(A, row, &count, &columns, &values));
  }
}

/// Of this process so far [s].
double processor_time();

/// Largest resident size so far, the ranks' added up [bytes]. Collective.
double peak_memory(MPI_Comm comm);

/// Registers (once) and enters a -log_view stage for as long as it lives.
class LogStage
{
public:
  explicit LogStage(const char* name);
  ~LogStage();
  LogStage(const LogStage&) = delete;
  LogStage& operator=(const LogStage&) = delete;
};

MPI_Comm comm_of(Vec x);
MPI_Comm comm_of(Mat A);
int rank_of(MPI_Comm comm);
int ranks_of(MPI_Comm comm);

} // namespace squeal
