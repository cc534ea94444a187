#pragma once
/// PETSc and SLEPc: the session, the error check, the one handle that owns a library object, and small helpers.
///
/// The API of the libraries stays visible: functions borrow raw handles (Vec, Mat, ...), results own them (Owned<Vec>).
#include "squeal/base/error.hpp"
#include "squeal/base/finally.hpp"

#include <exception>
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

/// Initialises MPI, PETSc and SLEPc, and finalises them at the end. Between, a failed call leaves PETSc's text for
/// check.
class Session
{
public:
  Session(int& argc, char**& argv, const char* help);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
};

/// Throws LibraryError if a library call failed, with PETSc's text and the file and line of the caller.
void check(PetscErrorCode code, std::source_location where = std::source_location::current());

/// For functions that PETSc calls back, whose C code must not be unwound: runs `work`. An exception is kept in
/// `failure`, and the library gets an error code.
template <class Work> PetscErrorCode guarded(std::exception_ptr& failure, Work work)
{
  try
  {
    work();
  }
  catch (...)
  {
    failure = std::current_exception();
    return PETSC_ERR_LIB;
  }
  return PETSC_SUCCESS;
}

/// After the library call: throws the exception that a callback kept, else what the call itself reports.
inline void check_after_callbacks(PetscErrorCode code, const std::exception_ptr& failure)
{
  if (failure) std::rethrow_exception(failure);
  check(code);
}

/// Sole owner of a PETSc or SLEPc object. It can be moved but not copied, and is the only place that destroys one.
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
  ~Owned() { (void)destroy(); }

  operator Handle() const { return handle_; } // lends the handle to a library call
  Handle get() const { return handle_; }

  /// Destroys what is owned and returns the address for a library call that creates a new object.
  Handle* put()
  {
    check(destroy());
    return &handle_;
  }

private:
  PetscErrorCode destroy()
  {
    auto object = reinterpret_cast<PetscObject>(std::exchange(handle_, nullptr));
    return object ? PetscObjectDestroy(&object) : PetscErrorCode(PETSC_SUCCESS);
  }

  Handle handle_ = nullptr;
};

/// Another owner of the object, which is then not changed; null if it is null.
template <class Handle> Owned<Handle> shared(Handle handle)
{
  if (handle) check(PetscObjectReference(reinterpret_cast<PetscObject>(handle)));
  return Owned<Handle>(handle);
}

/// Returns a vector of the same layout with zero entries.
Owned<Vec> zeros_like(Vec pattern);

/// Return a vector for x, or for y, of y = A x. On the layouts that A has, so that no message is sent: the ranks would
/// agree on those of MatCreateVecs by two messages.
Owned<Vec> vector_of_columns(Mat A);
Owned<Vec> vector_of_rows(Mat A);

/// A x, and A'. Collective.
Owned<Vec> product(Mat A, Vec x);
Owned<Mat> transpose_of(Mat A);

/// x.y, and norms. Collective.
double dot(Vec x, Vec y);
double norm_of(Vec x, NormType type);
double norm_of(Mat A, NormType type);

/// Numbers on all ranks.
PetscInt entry_count(Vec x);
PetscInt row_count(Mat A);
PetscInt column_count(Mat A);

/// A range of numbers, without the last.
struct IndexRange
{
  PetscInt first = 0, last = 0;

  PetscInt size() const { return last - first; }
  bool holds(PetscInt number) const { return number >= first && number < last; }
};

/// The share of this rank: entries, rows, and columns as of the vectors that A multiplies.
IndexRange own_range(Vec x);
IndexRange own_rows(Mat A);
IndexRange own_columns(Mat A);

/// Return a vector, and a matrix, of the same layout and entries.
Owned<Vec> copy_of(Vec source);
Owned<Mat> copy_of(Mat source);

/// Returns all entries of a small distributed vector on every rank. Collective.
std::vector<double> all_entries(Vec x);

/// Sets this rank's entries of x from a list of all entries.
void set_all_entries(Vec x, std::span<const double> entries);

/// Numbers of rows of an object on each rank, as MPI's collective calls take them.
struct RowLayout
{
  std::vector<int> counts; // number of rows on each rank
  std::vector<int> starts; // first row of each rank
  int total() const { return starts.back() + counts.back(); }
};

/// Return the layout of a vector, and of a matrix's rows. Throw LibraryError if a number exceeds int.
RowLayout row_layout(Vec x);
RowLayout row_layout(Mat A);

/// Calls visit(row, columns, values) for every row of this rank. The spans are valid during the call only.
template <class Visit> void for_each_row(Mat A, Visit visit)
{
  const auto [first, last] = own_rows(A);
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

/// Returns the processor time that this process has used so far [s].
double processor_time();

/// Returns the largest resident size of each process so far, summed over the ranks [bytes]. Collective.
double peak_memory(MPI_Comm comm);

/// Enters a stage of -log_view for as long as the object lives. A new name is registered.
Finally log_stage(const char* name);

/// The communicator of an object; rank and number of ranks in a communicator. None is collective.
MPI_Comm comm_of(Vec x);
MPI_Comm comm_of(Mat A);
int rank_of(MPI_Comm comm);
int ranks_of(MPI_Comm comm);

} // namespace squeal
