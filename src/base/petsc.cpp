#include "squeal/base/petsc.hpp"

#include <algorithm>
#include <ctime>
#include <fstream>
#include <string>
#include <sys/resource.h>

namespace squeal
{

namespace
{

// The text of the innermost failure; PETSc calls the handler from the inside out.
std::string& last_failure()
{
  static std::string text;
  return text;
}

PetscErrorCode keep_failure(MPI_Comm, int line, const char* function, const char* file, PetscErrorCode code,
                            PetscErrorType type, const char* message, void*)
{
  if (type == PETSC_ERROR_INITIAL)
    last_failure() = std::string(message ? message : "") + " (" + (function ? function : "?") + ", " +
                     (file ? file : "?") + ":" + std::to_string(line) + ")";
  return code;
}

Shares shares_of(const PetscInt* ranges, MPI_Comm comm)
{
  Shares shares;
  for (int rank = 0; rank < ranks_of(comm); ++rank)
  {
    shares.starts.push_back(static_cast<int>(ranges[rank]));
    shares.counts.push_back(static_cast<int>(ranges[rank + 1] - ranges[rank]));
  }
  return shares;
}

} // namespace

Session::Session(int& argc, char**& argv, const char* help)
{
  if (SlepcInitialize(&argc, &argv, nullptr, help)) throw Error("PETSc and SLEPc did not start");
  check(PetscPushErrorHandler(keep_failure, nullptr));
}

Session::~Session()
{
  (void)PetscPopErrorHandler();
  (void)SlepcFinalize();
}

void check(PetscErrorCode code, std::source_location where)
{
  if (code == PETSC_SUCCESS) return;
  const char* kind = nullptr;
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

Owned<Vec> copy_of(Vec source)
{
  Owned<Vec> result;
  check(VecDuplicate(source, result.put()));
  check(VecCopy(source, result));
  return result;
}

std::vector<double> whole(Vec x)
{
  const Shares shares = shares_of(x);
  std::vector<double> result(static_cast<std::size_t>(shares.total()));
  const PetscScalar* mine = nullptr;
  check(VecGetArrayRead(x, &mine));
  MPI_Allgatherv(mine, shares.counts[static_cast<std::size_t>(rank_of(comm_of(x)))], MPI_DOUBLE, result.data(),
                 shares.counts.data(), shares.starts.data(), MPI_DOUBLE, comm_of(x));
  check(VecRestoreArrayRead(x, &mine));
  return result;
}

void set_whole(Vec x, std::span<const double> entries)
{
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(x, &first, &last));
  PetscScalar* mine = nullptr;
  check(VecGetArrayWrite(x, &mine));
  std::copy(entries.begin() + first, entries.begin() + last, mine);
  check(VecRestoreArrayWrite(x, &mine));
}

Shares shares_of(Vec x)
{
  const PetscInt* ranges = nullptr;
  check(VecGetOwnershipRanges(x, &ranges));
  return shares_of(ranges, comm_of(x));
}

Shares shares_of(Mat A)
{
  const PetscInt* ranges = nullptr;
  check(MatGetOwnershipRanges(A, &ranges));
  return shares_of(ranges, comm_of(A));
}

double processor_time()
{
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double peak_memory(MPI_Comm comm)
{
  double bytes = 0;
  std::ifstream status("/proc/self/status"); // getrusage inherits the size of whoever started the process
  for (std::string word; status >> word;)
    if (word == "VmHWM:" && status >> bytes) bytes *= 1024;
  if (bytes == 0)
  {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    bytes = 1024. * static_cast<double>(usage.ru_maxrss);
  }
  MPI_Allreduce(MPI_IN_PLACE, &bytes, 1, MPI_DOUBLE, MPI_SUM, comm);
  return bytes;
}

LogStage::LogStage(const char* name)
{
  PetscLogStage stage = -1;
  check(PetscLogStageGetId(name, &stage));
  if (stage < 0) check(PetscLogStageRegister(name, &stage));
  check(PetscLogStagePush(stage));
}

LogStage::~LogStage()
{
  (void)PetscLogStagePop();
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
