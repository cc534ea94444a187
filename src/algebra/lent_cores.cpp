#include "squeal/algebra/lent_cores.hpp"

#include <algorithm>
#include <chrono>
#include <dlfcn.h>
#include <thread>

#ifdef __linux__
#include <sched.h>
#endif

namespace squeal
{

namespace
{

/// Cores that this process may run on.
int allowed_cores()
{
#ifdef __linux__
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) == 0) return CPU_COUNT(&set);
#endif
  return 1;
}

int ranks_of_node(MPI_Comm comm)
{
  MPI_Comm node = MPI_COMM_NULL;
  MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node);
  int ranks = 1;
  MPI_Comm_size(node, &ranks);
  MPI_Comm_free(&node);
  return ranks;
}

template <class Function> Function* function_of_blas(const char* name)
{
  return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}

/// 0: BLAS does not tell.
int threads_of_blas()
{
  auto* const get = function_of_blas<int()>("openblas_get_num_threads");
  return get ? get() : 0;
}

void set_threads(int threads)
{
  if (auto* const set = function_of_blas<void(int)>("openblas_set_num_threads")) set(threads);
}

} // namespace

LentCores::LentCores(MPI_Comm comm, std::size_t rows) : comm_(ranks_of(comm) > 1 && rows >= 500 ? comm : MPI_COMM_NULL)
{
  if (comm_ == MPI_COMM_NULL) return;
  const int threads = std::min(ranks_of_node(comm), allowed_cores());
  const int before = threads_of_blas();
  if (rank_of(comm) != 0 || before == 0 || before >= threads) return;
  threads_ = before;
  set_threads(threads);
}

LentCores::~LentCores()
{
  if (comm_ == MPI_COMM_NULL) return;
  if (threads_ > 0) set_threads(threads_);
  MPI_Request ended = MPI_REQUEST_NULL;
  MPI_Ibarrier(comm_, &ended);
  if (rank_of(comm_) == 0)
  {
    MPI_Wait(&ended, MPI_STATUS_IGNORE);
    return;
  }
  constexpr auto pause = std::chrono::microseconds(200); // MPI's own waiting would take the core
  int done = 0;
  for (MPI_Test(&ended, &done, MPI_STATUS_IGNORE); !done; MPI_Test(&ended, &done, MPI_STATUS_IGNORE))
    std::this_thread::sleep_for(pause);
}

Finally one_thread()
{
  const int before = threads_of_blas();
  if (before > 1) set_threads(1);
  return Finally(
      [before]
      {
        if (before > 1) set_threads(before);
      });
}

} // namespace squeal
