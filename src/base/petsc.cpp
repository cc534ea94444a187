#include "squeal/base/petsc.hpp"

#include <string>

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
  const auto comm = PetscObjectComm(reinterpret_cast<PetscObject>(x));
  const PetscInt* ranges = nullptr;
  check(VecGetOwnershipRanges(x, &ranges));
  const auto ranks = static_cast<std::size_t>(ranks_of(comm));
  std::vector<int> counts(ranks), starts(ranks);
  for (std::size_t rank = 0; rank < ranks; ++rank)
  {
    starts[rank] = static_cast<int>(ranges[rank]);
    counts[rank] = static_cast<int>(ranges[rank + 1] - ranges[rank]);
  }
  std::vector<double> result(static_cast<std::size_t>(ranges[ranks]));
  const PetscScalar* mine = nullptr;
  check(VecGetArrayRead(x, &mine));
  MPI_Allgatherv(mine, counts[static_cast<std::size_t>(rank_of(comm))], MPI_DOUBLE, result.data(), counts.data(),
                 starts.data(), MPI_DOUBLE, comm);
  check(VecRestoreArrayRead(x, &mine));
  return result;
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
