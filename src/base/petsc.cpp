#include "squeal/base/petsc.hpp"

#include "squeal/base/available_memory.hpp"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <string>

namespace squeal
{

namespace
{

/// The text of the innermost failure. PETSc calls the handler from the innermost function outwards, and its handler
/// cannot hand the text to check in any other way.
std::string& last_failure()
{
  static std::string text;
  return text;
}

/// PETSc's error handler: keeps the text of the innermost failure.
PetscErrorCode keep_failure(MPI_Comm, int line, const char* function, const char* file, PetscErrorCode code,
                            PetscErrorType type, const char* message, void*)
{
  if (type == PETSC_ERROR_INITIAL)
    last_failure() = std::string(message ? message : "") + " (" + (function ? function : "?") + ", " +
                     (file ? file : "?") + ":" + std::to_string(line) + ")";
  return code;
}

RowLayout row_layout(const PetscInt* ranges, MPI_Comm comm)
{
  const auto ranks = static_cast<std::size_t>(ranks_of(comm));
  RowLayout layout{std::vector<int>(ranks), std::vector<int>(ranks)};
  for (std::size_t rank = 0; rank < ranks; ++rank)
  {
    check(PetscMPIIntCast(ranges[rank], &layout.starts[rank]));
    check(PetscMPIIntCast(ranges[rank + 1] - ranges[rank], &layout.counts[rank]));
  }
  return layout;
}

Owned<Vec> vector_on(PetscLayout layout, MPI_Comm comm)
{
  Owned<Vec> result;
  check(VecCreate(comm, result.put()));
  check(VecSetLayout(result, layout));
  check(VecSetType(result, VECSTANDARD));
  return result;
}

} // namespace

Session::Session(int& argc, char**& argv, const char* help)
{
  sigset_t blocked; // a reader that is gone, such as head, is no reason to lose results; PETSc resets what is ignored
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGPIPE);
  sigprocmask(SIG_BLOCK, &blocked, nullptr);
  if (SlepcInitialize(&argc, &argv, nullptr, help)) throw Error("PETSc and SLEPc could not be initialised");
  check(PetscPushErrorHandler(keep_failure, nullptr));
  std::signal(SIGXFSZ, SIG_IGN); // a file beyond ulimit -f is an error of the writing call
}

Session::~Session()
{
  if (std::fflush(stdout) != 0) // PETSc would try again, and fail in a text of its own
  {
    if (errno != EPIPE)
      std::fprintf(stderr, "squeal: what was printed could not be written: %s\n", std::strerror(errno));
    if (!std::freopen("/dev/null", "w", stdout)) std::fclose(stdout);
  }
  (void)PetscPopErrorHandler();
  (void)SlepcFinalize();
}

void check(PetscErrorCode code, std::source_location where)
{
  if (code == PETSC_SUCCESS) return;
  const char* kind = nullptr;
  if (code == PETSC_ERR_MEM) throw LibraryError(out_of_memory_text);
  (void)PetscErrorMessage(code, &kind, nullptr);
  std::string text = std::exchange(last_failure(), {});
  if (text.empty()) text = "no detail given";
  throw LibraryError(std::string("PETSc error ") + std::to_string(static_cast<int>(code)) +
                     (kind ? std::string(", ") + kind : "") + ": " + text + "; called from " + where.file_name() + ":" +
                     std::to_string(where.line()));
}

Owned<Vec> zeros_like(Vec pattern)
{
  Owned<Vec> result;
  check(VecDuplicate(pattern, result.put()));
  check(VecSet(result, 0));
  return result;
}

Owned<Vec> vector_of_columns(Mat A)
{
  PetscLayout columns = nullptr;
  check(MatGetLayouts(A, nullptr, &columns));
  return vector_on(columns, comm_of(A));
}

Owned<Vec> vector_of_rows(Mat A)
{
  PetscLayout rows = nullptr;
  check(MatGetLayouts(A, &rows, nullptr));
  return vector_on(rows, comm_of(A));
}

Owned<Vec> product(Mat A, Vec x)
{
  Owned<Vec> result = vector_of_rows(A);
  check(MatMult(A, x, result));
  return result;
}

double dot(Vec x, Vec y)
{
  double product = 0;
  check(VecDot(x, y, &product));
  return product;
}

double norm_of(Vec x, NormType type)
{
  double norm = 0;
  check(VecNorm(x, type, &norm));
  return norm;
}

double norm_of(Mat A, NormType type)
{
  double norm = 0;
  check(MatNorm(A, type, &norm));
  return norm;
}

PetscInt entry_count(Vec x)
{
  PetscInt count = 0;
  check(VecGetSize(x, &count));
  return count;
}

PetscInt row_count(Mat A)
{
  PetscInt count = 0;
  check(MatGetSize(A, &count, nullptr));
  return count;
}

PetscInt column_count(Mat A)
{
  PetscInt count = 0;
  check(MatGetSize(A, nullptr, &count));
  return count;
}

IndexRange own_range(Vec x)
{
  IndexRange range;
  check(VecGetOwnershipRange(x, &range.first, &range.last));
  return range;
}

IndexRange own_rows(Mat A)
{
  IndexRange range;
  check(MatGetOwnershipRange(A, &range.first, &range.last));
  return range;
}

IndexRange own_columns(Mat A)
{
  IndexRange range;
  check(MatGetOwnershipRangeColumn(A, &range.first, &range.last));
  return range;
}

Owned<Mat> transpose_of(Mat A)
{
  Owned<Mat> result;
  check(MatTranspose(A, MAT_INITIAL_MATRIX, result.put()));
  return result;
}

Owned<Vec> copy_of(Vec source)
{
  Owned<Vec> result;
  check(VecDuplicate(source, result.put()));
  check(VecCopy(source, result));
  return result;
}

Owned<Mat> copy_of(Mat source)
{
  Owned<Mat> result;
  check(MatDuplicate(source, MAT_COPY_VALUES, result.put()));
  return result;
}

std::vector<double> all_entries(Vec x)
{
  const RowLayout layout = row_layout(x);
  std::vector<double> result(static_cast<std::size_t>(layout.total()));
  const PetscScalar* own = nullptr;
  check(VecGetArrayRead(x, &own));
  MPI_Allgatherv(own, layout.counts[rank_of(comm_of(x))], MPI_DOUBLE, result.data(), layout.counts.data(),
                 layout.starts.data(), MPI_DOUBLE, comm_of(x));
  check(VecRestoreArrayRead(x, &own));
  return result;
}

void set_all_entries(Vec x, std::span<const double> entries)
{
  const auto [first, last] = own_range(x);
  PetscScalar* own = nullptr;
  check(VecGetArrayWrite(x, &own));
  std::copy(entries.begin() + first, entries.begin() + last, own);
  check(VecRestoreArrayWrite(x, &own));
}

RowLayout row_layout(Vec x)
{
  const PetscInt* ranges = nullptr;
  check(VecGetOwnershipRanges(x, &ranges));
  return row_layout(ranges, comm_of(x));
}

RowLayout row_layout(Mat A)
{
  const PetscInt* ranges = nullptr;
  check(MatGetOwnershipRanges(A, &ranges));
  return row_layout(ranges, comm_of(A));
}

double processor_time()
{
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

double peak_memory(MPI_Comm comm)
{
  // getrusage counts the size of the parent process too
  double bytes = memory_entry("/proc/self/status", "VmHWM:").value_or(0);
  MPI_Allreduce(MPI_IN_PLACE, &bytes, 1, MPI_DOUBLE, MPI_SUM, comm);
  return bytes;
}

Finally log_stage(const char* name)
{
  PetscLogStage stage = -1;
  check(PetscLogStageGetId(name, &stage));
  if (stage < 0) check(PetscLogStageRegister(name, &stage));
  check(PetscLogStagePush(stage));
  return Finally([] { (void)PetscLogStagePop(); });
}

MPI_Comm comm_of(Vec x)
{
  return PetscObjectComm(reinterpret_cast<PetscObject>(x));
}

MPI_Comm comm_of(Mat A)
{
  return PetscObjectComm(reinterpret_cast<PetscObject>(A));
}

int rank_of(MPI_Comm comm)
{
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  return rank;
}

int ranks_of(MPI_Comm comm)
{
  int ranks = 1;
  MPI_Comm_size(comm, &ranks);
  return ranks;
}

} // namespace squeal
